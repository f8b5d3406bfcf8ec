// Buttons that clients made toggles, as VRPN's button filter knows them.
#pragma once

#include <cstdint>
#include <vector>

#include "wire/messages.h"

namespace hapticd::server {

/// One device's buttons between the servo and the reports. Net thread.
class ButtonModes {
 public:
  /// Above 31 buttons the others are momentary for ever.
  explicit ButtonModes(int count) : count_(count) {}

  /// Obeys an Admin message; what its toggles then stand at is appended to `alerts`. Returns false for a
  /// button that does not exist or a mode that is none; `error` then says what was wrong.
  bool setMode(const wire::ButtonAdmin& admin, std::vector<wire::ButtonAlert>& alerts, std::string& error);

  /// From the device's buttons to what clients see: a toggle changes when its button goes down.
  std::uint32_t apply(std::uint32_t pressed, std::vector<wire::ButtonAlert>& alerts);

 private:
  int count_;
  std::uint32_t toggles_ = 0;  // which buttons are toggles
  std::uint32_t on_ = 0;       // which of these are on
  std::uint32_t before_ = 0;   // the device's buttons of the tick before
};

}  // namespace hapticd::server

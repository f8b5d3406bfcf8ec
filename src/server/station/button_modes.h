// Toggle modes of buttons, as in VRPN's button filter.
#pragma once

#include <cstdint>
#include <vector>

#include "wire/messages.h"

namespace hapticd::server {

/// Converts the buttons of one device from the servo to the reports. Net thread.
class ButtonModes {
 public:
  /// `count`: number of buttons, at most 32; further ones are always momentary.
  explicit ButtonModes(int count) : count_(count) {}

  /// Applies an Admin message; one that makes all buttons toggles keeps the state of those that are. Returns
  /// false for an unknown button or mode; `error` is then the reason.
  bool setMode(const wire::ButtonAdmin& admin, std::string& error);

  /// Converts the device's button bits to the reported ones: a toggle changes when its button is pressed.
  /// Appends the state of each button whose mode or toggle changed since the last call to `alerts`, once: in
  /// between, clients may send any number of Admin messages.
  std::uint32_t apply(std::uint32_t pressed, std::vector<wire::ButtonAlert>& alerts);

 private:
  int count_;
  std::uint32_t toggles_ = 0;  // which buttons are toggles
  std::uint32_t on_ = 0;       // which toggles are on
  std::uint32_t changed_ = 0;  // which buttons changed since the last call of apply()
  std::uint32_t before_ = 0;   // the device's buttons in the previous tick
};

}  // namespace hapticd::server

// Messages of the Inverse Service, as JSON text; converts frames and units to ours.
#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "device/device.h"

namespace hapticd::device::haply {

/// An invalid message of the service; the text quotes it.
class MessageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One Inverse3 and its grip, from one message.
struct Message {
  std::string deviceId;
  DeviceState state;  ///< without its time
};

/// The Inverse3 with this id, or the first one when `wantedId` is empty; none when the message names none.
/// Throws MessageError. Forces are held while the service says that the device is not calibrated or not
/// ready.
std::optional<Message> parseMessage(std::string_view text, const std::string& wantedId);

/// The command for a force in our frame.
std::string forceMessage(const std::string& deviceId, const Vec3& force_N);

}  // namespace hapticd::device::haply

// The JSON of the Inverse Service's simulation channel, seen from its server: pure, no socket.
//
// Names and units are those that the service's documentation and its public clients use. Its frame is x
// right, y away from the user, z up; metres, m/s, newtons.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "device/device.h"

namespace hapticd::server::haply {

using geometry::Vec3;

/// One device as a frame shows it, in our device frame.
struct ShownDevice {
  std::string id;
  device::DeviceState state;
  Vec3 force_N = Vec3::Zero();  ///< as written to the device
  bool inUse = false;           ///< a client's force is held
  bool isOff = false;           ///< forces are stopped, not enabled, or off for a fault until a re-arm
};

/// One state frame. `config`: with what only the first frame of a connection carries.
std::string stateFrame(std::uint32_t session, const std::vector<ShownDevice>& devices, bool config);

/// A force that a client wants on one device, in our device frame.
struct WantedForce {
  std::string device;
  Vec3 force_N = Vec3::Zero();
};

/// What a client's message asks for.
struct Commands {
  std::vector<WantedForce> forces;
  bool wantsConfig = false;          ///< the next frame is a full one
  std::vector<std::string> ignored;  ///< names of commands that are not supported, each once
};

/// A message that is no command; the text names what is wrong.
class MessageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws MessageError. Two forces for one device are added, as the service documents it.
Commands parseCommands(std::string_view text);

}  // namespace hapticd::server::haply

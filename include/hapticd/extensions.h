// What servers of this project support beyond VRPN, as plain values; see Client.
#pragma once

#include <array>
#include <cstdint>

namespace hapticd {

/// What a server and one of its devices support.
struct Capabilities {
  int version = 0;         ///< of the extensions, from 1
  bool bulkMesh = false;   ///< meshes in messages of thousands of vertices
  bool batch = false;      ///< Client::batch()
  bool subscribe = false;  ///< Client::subscribe()
  bool stop = false;       ///< Client::stopForces() and rearmForces()
  bool heartbeat = false;  ///< Client::enableHeartbeat()
  bool holdHand = false;   ///< Client::holdHand(): the device is simulated
  double servoRate_Hz = 0;
  double reportRate_Hz = 0;  ///< unless a client chooses its own
  double peakForce_N = 0;
  int buttons = 0;                         ///< number of buttons
  std::array<double, 3> workspaceMin_m{};  ///< reach of the device in its own frame, real metres
  std::array<double, 3> workspaceMax_m{};
  bool remoteContacts = false;  ///< Client::setRemoteContacts(), setForce() and Reports::hand
};

/// Kinds of reports to subscribe to; combine them by |. Force errors, guard states and texts are always sent.
enum class Reports : std::uint32_t {
  none = 0,
  tracker = 1,  ///< poses and velocities
  force = 2,    ///< force, contact point, depth, touching, touched object, angle
  button = 4,
  analog = 8,
  tick = 16,      ///< TickReport
  contacts = 32,  ///< ContactsReport
  hand = 64,      ///< HandReport
  usual = 15,     ///< what a client without a subscription receives
  all = 127
};
constexpr Reports operator|(Reports a, Reports b) {
  return static_cast<Reports>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));
}

/// Target of the simulated hand.
struct HandPose {
  std::array<double, 3> position{};               ///< world units, world frame
  std::array<double, 4> orientation{0, 0, 0, 1};  ///< quaternion x y z w, from stylus to world
  std::uint32_t buttons = 0;                      ///< bit 0: button 0 is down
};

}  // namespace hapticd

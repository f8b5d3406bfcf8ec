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
  proxy = 1,  ///< poses of sensor 0, the proxy
  force = 2,  ///< force, contact point, depth, touching, touched object, angle
  button = 4,
  analog = 8,           ///< the opening of a gripper
  tick = 16,            ///< TickReport
  contacts = 32,        ///< ContactsReport
  hand = 64,            ///< HandReport
  contactPoint = 128,   ///< poses of sensor 2, the surface contact point
  touchButton = 256,    ///< contact as one more button than the device has
  contactAnalog = 512,  ///< contact as analog channels, see AnalogReport
  hip = 1024,           ///< poses and velocities of sensor 1, the device itself
  tracker = proxy | hip | contactPoint,
  usual = tracker | force | button | analog,  ///< what a Client receives that did not subscribe
  all = 2047
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

// What servers of this project can do beyond VRPN, as plain values; see Client.
#pragma once

#include <array>
#include <cstdint>

namespace hapticd {

/// What a server and one device of it can do.
struct Capabilities {
  int version = 0;         ///< of the extensions, from 1
  bool bulk_mesh = false;  ///< meshes by thousands of vertices a message
  bool batch = false;      ///< Client::batch()
  bool subscribe = false;  ///< Client::subscribe()
  bool stop = false;       ///< Client::stopForces() and rearmForces()
  bool heartbeat = false;  ///< Client::enableHeartbeat()
  bool hold_hand = false;  ///< Client::holdHand(): the device is simulated
  double servo_rate_Hz = 0;
  double report_rate_Hz = 0;  ///< as long as a client does not choose its own
  double peak_force_N = 0;
  int buttons = 0;
  std::array<double, 3> workspace_min_m{};  ///< of the device, in its own frame
  std::array<double, 3> workspace_max_m{};
};

/// Kinds of reports to subscribe to; combine them by |. Errors, guard states and texts always come.
enum class Reports : std::uint32_t {
  none = 0,
  tracker = 1,  ///< poses and velocities
  force = 2,    ///< force, contact point, depth, touching, touched object, angle
  button = 4,
  analog = 8,
  tick = 16,      ///< TickReport
  contacts = 32,  ///< ContactsReport
  usual = 15,     ///< what comes without a subscription
  all = 63
};
constexpr Reports operator|(Reports a, Reports b) {
  return static_cast<Reports>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));
}

/// Where a simulated hand should go.
struct HandPose {
  std::array<double, 3> position{};               ///< world units
  std::array<double, 4> orientation{0, 0, 0, 1};  ///< quaternion x y z w
  std::uint32_t buttons = 0;                      ///< bit 0: button 0 is down
};

}  // namespace hapticd

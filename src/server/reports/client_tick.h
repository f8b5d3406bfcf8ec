// A tick in the client's frame and units.
#pragma once

#include <optional>

#include "realtime/servo/report.h"
#include "server/config/config.h"

namespace hapticd::server {

/// Reported lengths are world units divided by this: metres when one world unit is a millimetre, as in the
/// paper.
inline constexpr double kWorldPerReported = 1000;

/// One tick in the world frame: lengths in reported metres (world units / 1000), forces in newtons.
struct ClientTick {
  double metre = 1;                              ///< reported length of a metre of the device
  geometry::Vec3 proxy, hip, velocity, force_N;  ///< `velocity`: reported metres per second
  geometry::Vec3 scp = geometry::Vec3::Zero();   ///< of the touched object; zero without contact
  geometry::Quat orientation;
  geometry::Vec3 angularVelocity;  ///< rad/s
  bool touching = false;
  std::int32_t object = -1;
  double depth = 0;      ///< depth of penetration
  double angle_deg = 0;  ///< between the stylus and the surface normal
  std::optional<double> gripper_rad;
};

/// Converts a tick; `forceReport` chooses between the total force and the normal force without the guard.
ClientTick toClientTick(const realtime::TickReport& tick, ForceReport forceReport);

/// Reported metres of a device position in metres.
inline geometry::Vec3 reported(const realtime::TickReport& tick, const geometry::Vec3& position_m) {
  return tick.T_world_device * position_m / kWorldPerReported;
}

/// The rotation part of the map from device to world.
geometry::Mat3 rotationOf(const geometry::Affine& T_world_device);

}  // namespace hapticd::server

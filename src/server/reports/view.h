// A tick in the client's terms.
#pragma once

#include <optional>

#include "realtime/servo/report.h"
#include "server/config/config.h"

namespace hapticd::server {

/// Reported lengths are world units over this: metres when the world is in millimetres, as the paper has it.
inline constexpr double kWorldPerReported = 1000;

/// What the hand feels in one tick: reported metres, the world's frame, newtons.
struct View {
  geometry::Vec3 proxy, hip, scp, velocity, force_N;
  geometry::Quat orientation;
  geometry::Vec3 angularVelocity;  ///< rad/s
  bool touching = false;
  std::int32_t object = -1;
  double depth = 0;
  double angle_deg = 0;  ///< between the stylus and the surface normal
  std::optional<double> gripper_rad;
};

View viewOf(const realtime::TickReport& tick, ForceReport forceReport);

/// World units of a device position in metres.
inline geometry::Vec3 reported(const realtime::TickReport& tick, const geometry::Vec3& position_m) {
  return tick.T_world_device * position_m / kWorldPerReported;
}

/// The rotation part of the map from device to world.
geometry::Mat3 rotationOf(const realtime::TickReport& tick);

}  // namespace hapticd::server

#include "server/reports/view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hapticd::server {
namespace {

using geometry::Mat3;
using geometry::Quat;
using geometry::Vec3;

double scaleOf(const Mat3& linear) {
  return std::cbrt(std::abs(linear.determinant()));
}

}  // namespace

Mat3 rotationOf(const realtime::TickReport& tick) {
  const Mat3 linear = tick.T_world_device.linear();
  return linear / scaleOf(linear);
}

View viewOf(const realtime::TickReport& tick, ForceReport forceReport) {
  const Mat3 linear = tick.T_world_device.linear();
  const Mat3 rotation = rotationOf(tick);
  const realtime::Rendering& felt = tick.rendering;

  View view;
  view.proxy = reported(tick, felt.proxy_m);
  view.hip = reported(tick, tick.device.position_m);
  view.scp = reported(tick, felt.scp_m);
  view.velocity = linear * tick.device.velocity_m_per_s / kWorldPerReported;
  view.angularVelocity = rotation * tick.device.angularVelocity_rad_per_s;
  view.orientation = (Quat(rotation) * tick.device.orientation).normalized();
  view.gripper_rad = tick.device.gripper_rad;
  view.force_N = rotation * (forceReport == ForceReport::normal ? felt.normalForce_N : tick.force_N);
  view.touching = felt.touching;
  view.object = felt.touching ? felt.touchedObject : -1;
  view.depth = felt.touching ? felt.depth_m * scaleOf(linear) / kWorldPerReported : 0;
  if (felt.touching) {
    const Vec3 stylus = tick.device.orientation * Vec3::UnitY();
    view.angle_deg = std::acos(std::clamp(stylus.dot(felt.normal), -1.0, 1.0)) * 180 / std::numbers::pi;
  }
  return view;
}

}  // namespace hapticd::server

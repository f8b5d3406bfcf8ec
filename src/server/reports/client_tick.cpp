#include "server/reports/client_tick.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hapticd::server {

using geometry::Mat3;
using geometry::Quat;
using geometry::scaleOf;
using geometry::Vec3;

Mat3 rotationOf(const geometry::Affine& T_world_device) {
  const Mat3 linear = T_world_device.linear();
  return linear / scaleOf(linear);
}

ClientTick toClientTick(const realtime::TickReport& tick, ForceReport forceReport) {
  const Mat3 linear = tick.T_world_device.linear();
  const Mat3 rotation = rotationOf(tick.T_world_device);
  const realtime::Rendering& rendering = tick.rendering;

  ClientTick clientTick;
  clientTick.metre = scaleOf(linear) / kWorldPerReported;
  clientTick.proxy = reported(tick, rendering.proxy_m);
  clientTick.hip = reported(tick, tick.device.position_m);
  clientTick.velocity = linear * tick.device.velocity_m_per_s / kWorldPerReported;
  clientTick.angularVelocity = rotation * tick.device.angularVelocity_rad_per_s;
  clientTick.orientation = (Quat(rotation) * tick.device.orientation).normalized();
  clientTick.gripper_rad = tick.device.gripper_rad;
  clientTick.force_N =
      rotation * (forceReport == ForceReport::normal ? rendering.normalForce_N : tick.force_N);
  clientTick.touching = rendering.touching;
  clientTick.object = rendering.touching ? rendering.touchedObject : -1;
  clientTick.depth = rendering.touching ? rendering.depth_m * clientTick.metre : 0;
  if (const realtime::Contact* contact = touchedContact(rendering)) {
    const Vec3 stylus = tick.device.orientation * Vec3::UnitY();
    clientTick.angle_deg =
        std::acos(std::clamp(stylus.dot(contact->normal), -1.0, 1.0)) * 180 / std::numbers::pi;
    clientTick.scp = reported(tick, contact->point_m);
  }
  return clientTick;
}

}  // namespace hapticd::server

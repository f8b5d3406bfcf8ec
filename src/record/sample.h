// What CSV and MCAP files say of a tick.
#pragma once

#include "record/fields.h"

namespace hapticd::record {

/// One tick of a session. The device's frame, SI.
struct Sample {
  std::string device;
  Nanos time_ns = 0;  ///< since the epoch
  std::uint64_t tick = 0;
  std::uint64_t revision = 0;
  geometry::Vec3 hand_m = geometry::Vec3::Zero();
  geometry::Vec3 proxy_m = geometry::Vec3::Zero();
  geometry::Vec3 velocity_m_per_s = geometry::Vec3::Zero();
  geometry::Quat orientation = geometry::Quat::Identity();
  geometry::Vec3 force_N = geometry::Vec3::Zero();  ///< as written to the device
  double depth_m = 0;
  bool touching = false;
  std::int32_t object = -1;
  std::uint32_t buttons = 0;
  std::uint32_t guardActive = 0;
  std::uint32_t guardLatched = 0;
  std::optional<double> gripper_rad{};
};

template <Is<Sample> T, class V>
void fields(T& sample, V&& v) {
  auto& [device, time_ns, tick, revision, hand_m, proxy_m, velocity_m_per_s, orientation, force_N, depth_m,
         touching, object, buttons, guardActive, guardLatched, gripper_rad] = sample;
  v("device", device);
  v("time_ns", time_ns);
  v("tick", tick);
  v("revision", revision);
  v("hand_m", hand_m);
  v("proxy_m", proxy_m);
  v("velocity_m_per_s", velocity_m_per_s);
  v("orientation_xyzw", orientation);
  v("force_N", force_N);
  v("depth_m", depth_m);
  v("touching", touching);
  v("object", object);
  v("buttons", buttons);
  v("guard_active", guardActive);
  v("guard_latched", guardLatched);
  v("gripper_rad", gripper_rad);
}

/// Of a tick, with times since the epoch.
Sample sampleOf(const std::string& device, const realtime::TickReport& tick, Nanos wallOffset);

}  // namespace hapticd::record

// One tick as other programs see it: the one list of columns and keys of `export`, `record`, `watch`, `render
// --out`, the black box and MCAP. `--hand` reads the same columns (device/simulated/hand_file.h).
//
// To add a field: here, in sampleOf(), and in docs/recording.md.
#pragma once

#include "hapticd/trips.h"
#include "record/fields.h"
#include "record/text_fields.h"

namespace hapticd::record {

/// One tick of a device. Device frame, SI. What a source does not know stays empty.
struct Sample {
  std::string device;
  Nanos time_ns = 0;  ///< since 1970, UTC; offline since the start
  std::uint64_t tick = 0;
  std::uint64_t revision = 0;  ///< of the scene that the tick saw
  geometry::Vec3 hip_m = geometry::Vec3::Zero();
  geometry::Vec3 proxy_m = geometry::Vec3::Zero();
  geometry::Vec3 velocity_m_per_s = geometry::Vec3::Zero();
  geometry::Quat orientation = geometry::Quat::Identity();
  geometry::Vec3 force_N = geometry::Vec3::Zero();  ///< as written to the device
  double depth_m = 0;                               ///< 0 when free
  bool touching = false;
  std::int32_t object = -1;  ///< -1 when free
  std::uint32_t buttons = 0;
  Trips guardActive;
  Trips guardLatched;
  std::optional<double> gripper_rad{};
  std::optional<geometry::Vec3> renderedForce_N{};  ///< before the guard
  std::optional<geometry::Vec3> normal{};           ///< of the touched object at that point; zero when free
  std::optional<geometry::Vec3> contactPoint_m{};   ///< on the touched object; empty when free
  std::optional<std::uint32_t> renderStatus{};      ///< bits of realtime::RenderStatus
  std::optional<Nanos> wakeupError_ns{};
  std::optional<Nanos> compute_ns{};  ///< the servo's time for the tick
};

template <Is<Sample> T, class V>
void fields(T& sample, V&& v) {
  auto& [device, time_ns, tick, revision, hip_m, proxy_m, velocity_m_per_s, orientation, force_N, depth_m,
         touching, object, buttons, guardActive, guardLatched, gripper_rad, renderedForce_N, normal,
         contactPoint_m, renderStatus, wakeupError_ns, compute_ns] = sample;
  v("device", device);
  v("time_ns", ExactNanos{time_ns});
  v("tick", tick);
  v("revision", revision);
  v("hip_m", hip_m);
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
  v("rendered_force_N", renderedForce_N);
  v("normal", normal);
  v("contact_point_m", contactPoint_m);
  v("render_status", renderStatus);
  v("wakeup_error_ns", wakeupError_ns);
  v("compute_ns", compute_ns);
}

/// `wallOffset` is added to the time of the servo clock.
inline Sample sampleOf(const std::string& device, const realtime::TickReport& tick, Nanos wallOffset) {
  const realtime::Rendering& rendering = tick.rendering;
  Sample sample;
  sample.device = device;
  sample.time_ns = tick.time + wallOffset;
  sample.tick = tick.tick;
  sample.revision = tick.revision;
  sample.hip_m = tick.device.position_m;
  sample.proxy_m = rendering.proxy_m;
  sample.velocity_m_per_s = tick.device.velocity_m_per_s;
  sample.orientation = tick.device.orientation;
  sample.force_N = tick.force_N;
  sample.touching = rendering.touching;
  sample.depth_m = rendering.touching ? rendering.depth_m : 0;
  sample.object = rendering.touching ? rendering.touchedObject : -1;
  sample.buttons = tick.device.buttons;
  sample.guardActive = Trips(tick.guard.active);
  sample.guardLatched = Trips(tick.guard.latched);
  sample.gripper_rad = tick.device.gripper_rad;
  sample.renderedForce_N = rendering.force_N;
  const realtime::Contact* contact = touchedContact(rendering);
  sample.normal = contact != nullptr ? contact->normal : geometry::Vec3(geometry::Vec3::Zero());
  if (contact != nullptr) sample.contactPoint_m = contact->point_m;
  sample.renderStatus = rendering.status;
  sample.wakeupError_ns = tick.timing.wakeupError;
  sample.compute_ns = tick.timing.compute;
  return sample;
}

}  // namespace hapticd::record

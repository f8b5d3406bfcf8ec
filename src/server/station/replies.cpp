#include "server/station/replies.h"

namespace hapticd::server {

using geometry::Box;
using geometry::Vec3;

Box workspaceOf(const DeviceConfig& config, const device::DeviceProfile& profile) {
  const auto& box = config.workspace_mm;
  if (box.size() != 6) return profile.workspace_m;
  return {Vec3(box[0], box[1], box[2]) * 1e-3, Vec3(box[3], box[4], box[5]) * 1e-3};
}

wire::TrackerWorkspace trackerWorkspace(const Box& box, const realtime::TickReport& tick) {
  Box world;
  for (int corner = 0; corner < 8; ++corner) {
    world.extend(reported(tick, Vec3((corner & 1) != 0 ? box.max.x() : box.min.x(),
                                     (corner & 2) != 0 ? box.max.y() : box.min.y(),
                                     (corner & 4) != 0 ? box.max.z() : box.min.z())));
  }
  const auto array = [](const Vec3& v) { return wire::F64x3{v.x(), v.y(), v.z()}; };
  return {array(world.min), array(world.max)};
}

wire::TrackerToRoom trackerToRoom(const ReportFrame& frame) {
  const Vec3& p = frame.origin;
  const geometry::Quat& q = frame.rotation;
  return {.position = {p.x(), p.y(), p.z()}, .orientation = {q.x(), q.y(), q.z(), q.w()}};
}

wire::Capabilities capabilities(const DeviceConfig& config, const device::DeviceProfile& profile,
                                bool takesInput, bool canBeHeld) {
  const Box box = workspaceOf(config, profile);
  return {.version = wire::kExtensionVersion,
          .features = wire::kFeatureBulkMesh | wire::kFeatureBatch | wire::kFeatureSubscribe |
                      wire::kFeatureStop | wire::kFeatureHeartbeat |
                      (takesInput ? wire::kFeatureRemoteContacts : 0U) |
                      (takesInput && canBeHeld ? wire::kFeatureHoldHand : 0U),
          .servoRate = config.servoRate_Hz,
          .reportRate = config.reportRate_Hz,
          .peakForce = profile.peakForce_N,
          .buttons = profile.buttons,
          .workspace = {box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z()}};
}

}  // namespace hapticd::server

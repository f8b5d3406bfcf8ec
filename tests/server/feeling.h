// Helpers that send a haptic scene and wait for its reports.
#pragma once

#include <cmath>
#include <limits>

#include "box.h"
#include "geometry/types.h"
#include "scripted_peer.h"

namespace hapticd::test {

using geometry::Vec3;
using geometry::Vec3f;

/// Sends one setVertex for each vertex.
inline void sendVertices(ScriptedPeer& peer, std::int32_t object, const std::vector<Vec3f>& vertices) {
  std::int32_t number = 0;
  for (const Vec3f& v : vertices) peer.queue(wire::SetVertex{object, number++, {v.x(), v.y(), v.z()}});
  peer.flush();
}

/// A stiff box of world units (or metres, for stock objects) whose top is at half.y().
inline void sendBox(ScriptedPeer& peer, std::int32_t object, const Vec3f& half,
                    const Vec3f& centre = Vec3f::Zero()) {
  sendVertices(peer, object, boxTriples(half, centre));
  peer.send(wire::SetHapticProperty{object, "stiffness", 1.0F});
}

/// A stiff cube with its top at 20 mm, within reach of Hand::stroking().
inline void sendCube(ScriptedPeer& peer, std::int32_t object = 0) {
  sendBox(peer, object, Vec3f::Constant(20));
}
inline constexpr double kCubeTop_m = 0.020;

/// Reads and discards everything that the server sent so far.
inline bool catchUp(ScriptedPeer& peer) {
  peer.send(wire::Ping{});
  const bool answered = peer.untilNext<wire::Pong>();
  peer.forget();
  return answered;
}

/// Waits for this many more report periods.
inline bool untilTicks(ScriptedPeer& peer, std::size_t ticks) {
  const std::size_t before = peer.count<wire::IsTouching>();
  return peer.until([&] { return peer.count<wire::IsTouching>() >= before + ticks; });
}

/// Waits until the scene has applied everything that the peer sent: a refused command after it is reported in
/// order.
inline bool untilApplied(ScriptedPeer& peer) {
  static std::int32_t effect = 1'000'000;
  peer.send(wire::StopEffect{++effect});
  return peer.untilText("stopEffect " + std::to_string(effect));
}

inline double norm(const wire::F64x3& v) {
  return std::hypot(v[0], v[1], v[2]);
}

/// Waits until this object is touched at this height.
inline bool untilTouchedAt(ScriptedPeer& peer, std::int32_t object, double height_m) {
  return peer.until([&] {
    const auto touched = peer.last<wire::TouchedObject>();
    const auto scp = peer.last<wire::Scp>();
    return touched && touched->object == object && scp && std::abs(scp->position[1] - height_m) < 2e-4;
  });
}
/// Waits until the hand has stroked down through the position of the cube's top without contact.
inline bool untilUntouchedStroke(ScriptedPeer& peer) {
  return peer.until([&] {
    const auto pose = peer.last<wire::TrackerPosQuat>([](const auto& m) { return m.sensor == 0; });
    return pose && pose->position[1] < 0.0165;
  });
}

/// Waits until this force is reported.
inline bool untilForce(ScriptedPeer& peer, const Vec3& force_N, double tolerance_N = 0.05) {
  return peer.until([&] {
    const auto force = peer.last<wire::Force>();
    return force && norm({force->force[0] - force_N.x(), force->force[1] - force_N.y(),
                          force->force[2] - force_N.z()}) <= tolerance_N;
  });
}
/// Waits until a larger force than this is reported.
inline bool untilForceAbove(ScriptedPeer& peer, double force_N) {
  return peer.until([&] {
    const auto force = peer.last<wire::Force>();
    return force && norm(force->force) > force_N;
  });
}

/// Subscribes to all tracker sensors: 0 the proxy, 1 the HIP, 2 the contact point.
inline void subscribeToSensors(ScriptedPeer& peer) {
  peer.send(wire::Subscribe{.kinds = wire::kReportDefault | wire::kReportHip | wire::kReportContactPoint,
                            .rate = 0});
}

/// Subscribes to the HIP (sensor 1) and waits until it is reported at this position.
inline bool untilHandAt(ScriptedPeer& peer, const Vec3& position_m, double tolerance_m = 5e-4) {
  if (!peer.untilConnected()) return false;
  subscribeToSensors(peer);
  return peer.until([&] {
    const auto pose = peer.last<wire::TrackerPosQuat>([](const auto& m) { return m.sensor == 1; });
    return pose && norm({pose->position[0] - position_m.x(), pose->position[1] - position_m.y(),
                         pose->position[2] - position_m.z()}) <= tolerance_m;
  });
}

}  // namespace hapticd::test

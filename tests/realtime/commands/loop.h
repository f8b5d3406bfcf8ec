// A scene builder, a renderer and simulated time: what a client's commands do to a hand.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "base/time.h"
#include "geometry/triangle_mesh.h"
#include "realtime/render/renderer.h"
#include "scene/builder.h"

namespace hapticd::realtime::commands {

using base::toNanos;
using geometry::Vec3;
using geometry::Vec3f;

inline constexpr Nanos kMs = 1'000'000;
inline constexpr double kStiffness_N_per_m = 500;  // of stiffness 1

/// Corners of the twelve triangles of a box, counter-clockwise from outside, millimetres.
inline std::vector<Vec3f> boxTriples(const Vec3& lower, const Vec3& upper) {
  std::vector<Vec3f> corners;
  const Vec3 centre = 0.5 * (lower + upper);
  const Vec3 half = 0.5 * (upper - lower);
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      for (const auto& [u, v] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}}) {
        Vec3 corner;
        corner[axis] = side;
        corner[(axis + 1) % 3] = side * u;
        corner[(axis + 2) % 3] = v;
        corners.emplace_back((centre + half.cwiseProduct(corner)).cast<float>());
      }
    }
  }
  return corners;
}

/// A square sheet in the plane y = height, front up, millimetres.
inline std::vector<Vec3f> sheetTriples(double half, double height = 0) {
  const auto h = static_cast<float>(half);
  const auto y = static_cast<float>(height);
  return {Vec3f(-h, y, -h), Vec3f(-h, y, h), Vec3f(h, y, h),
          Vec3f(-h, y, -h), Vec3f(h, y, h),  Vec3f(h, y, -h)};
}

/// The corners of all triangles.
inline std::vector<Vec3f> triplesOf(const geometry::TriangleMesh& mesh) {
  std::vector<Vec3f> corners;
  for (const geometry::Triangle& t : mesh.triangles) {
    for (const std::uint32_t vertex : t) corners.push_back(mesh.vertices[vertex]);
  }
  return corners;
}

class Loop {
 public:
  explicit Loop(const RenderOptions& options = {}, scene::SceneConfig config = {})
      : builder_(simulated(std::move(config))), renderer_(options) {
    publish();
  }

  template <class Command>
  void send(Command command, scene::ClientId client = 1) {
    builder_.apply(client, std::move(command), now, notices);
  }
  void leave(scene::ClientId client) { builder_.clientGone(client, now); }
  /// Publishes what is due; the scene thread does so after each command.
  void publish() {
    if (auto next = builder_.publish(now, notices)) scenes_.push_back(std::move(next));
  }
  /// An object of stiffness 1 that was published.
  void add(std::int32_t id, std::vector<Vec3f> triples) {
    if (id >= objects_) send(scene::SetObjectNumber{objects_ = id + 1});
    send(scene::SetVertices{id, 0, std::move(triples)});
    send(scene::SetSurfaceProperty{id, "stiffness", 1});
  }
  void place(std::int32_t id, const Vec3& position_mm) {
    send(scene::SetTransform{
        id, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, position_mm.x(), position_mm.y(), position_mm.z(), 1}});
    publish();
  }

  /// One tick, `period` after the last one.
  const Rendering& tick(const Vec3& hip_m, Nanos period = kMs) {
    now += period;
    publish();
    return render(hip_m, period);
  }
  /// One tick at the present time.
  const Rendering& render(const Vec3& hip_m, Nanos period) {
    state.position_m = hip_m;
    state.velocity_m_per_s = started_ ? Vec3((hip_m - last_) / base::toSeconds(period)) : Vec3(Vec3::Zero());
    started_ = true;
    last_ = hip_m;
    state.time = now;
    renderer_.step(*scenes_.back(), state, now, period, out);
    return out;
  }
  /// Ticks with a HIP at rest.
  const Rendering& rest(
      const Vec3& hip_m, Nanos duration, const std::function<void()>& each = [] {}) {
    for (Nanos t = 0; t < duration; t += kMs) {
      tick(hip_m);
      each();
    }
    return out;
  }
  /// Ticks on a straight line at 0.1 m/s.
  const Rendering& to(
      const Vec3& hip_m, const std::function<void()>& each = [] {}) {
    const Vec3 from = last_;
    const int ticks = std::max(1, static_cast<int>((hip_m - from).norm() / 1e-4));
    for (int i = 1; i <= ticks; ++i) {
      tick(from + (hip_m - from) * (static_cast<double>(i) / ticks));
      each();
    }
    return out;
  }
  const scene::SceneSnapshot& scene() const { return *scenes_.back(); }

  Nanos now = toNanos(1);
  Rendering out;
  device::DeviceState state;
  std::vector<scene::Notice> notices;

 private:
  static scene::SceneConfig simulated(scene::SceneConfig config) {
    config.stopwatch = [] { return Nanos{0}; };
    config.checkMeshes = false;
    return config;
  }

  scene::SceneBuilder builder_;
  Renderer renderer_;
  std::vector<std::shared_ptr<const scene::SceneSnapshot>> scenes_;
  std::int32_t objects_ = 0;
  bool started_ = false;
  Vec3 last_ = Vec3::Zero();
};

}  // namespace hapticd::realtime::commands

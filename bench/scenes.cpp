#include "bench/scenes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "base/time.h"
#include "geometry/rotation.h"

namespace hapticd::bench {
namespace {

using geometry::TriangleMesh;

constexpr double kPress_mm = 1.5;
constexpr double kTap_mm = 2;
constexpr double kTremor_mm = 0.01;
constexpr int kActTicks = 1000;
constexpr int kWayTicks = 300;
constexpr double kWayHeight_m = 0.008;

Vec3 onSphere(double polar, double around) {
  return {std::sin(polar) * std::cos(around), std::cos(polar), std::sin(polar) * std::sin(around)};
}

// Away from the poles, where the triangles of the ball are needles.
Vec3 slideDirection(double t) {
  return onSphere(1.5 + 0.5 * std::sin(1.3 * t), 1.9 * t);
}

// From where the hand is: up, round the ball and down again.
void addWay(const Vec3& to, std::vector<HandTick>& ticks) {
  const Vec3 from = ticks.back().position_m;
  const geometry::Quat turn = geometry::rotationBetween(from, to);
  for (int i = 1; i <= kWayTicks; ++i) {
    const double s = static_cast<double>(i) / (kWayTicks + 1);
    const double height = std::min(1.0, 4 * std::min(s, 1 - s)) * kWayHeight_m;
    const double ground = from.norm() + s * (to.norm() - from.norm());
    const Vec3 direction = geometry::Quat::Identity().slerp(s, turn) * from.normalized();
    ticks.push_back({Act::way, (ground + height) * direction});
  }
}

}  // namespace

double ballSurface_mm(const Vec3& direction, double radius_mm) {
  const Vec3 n = direction.normalized();
  return radius_mm * (1 + 0.02 * std::sin(9 * n.x()) * std::sin(8 * n.y()) * std::sin(7 * n.z()));
}

TriangleMesh makeBumpyBall(std::size_t triangles, double radius_mm) {
  // Rings of `around` vertices between two poles: 2 around (rings) triangles in all.
  const auto rings =
      static_cast<std::uint32_t>(std::max(2.0, std::round(std::sqrt(static_cast<double>(triangles) / 4))));
  const std::uint32_t around = 2 * rings;
  TriangleMesh mesh;
  mesh.vertices.reserve(std::size_t{rings} * around + 2);
  mesh.triangles.reserve(2 * std::size_t{rings} * around);
  const auto add = [&](const Vec3& n) {
    mesh.vertices.push_back((n * ballSurface_mm(n, radius_mm)).cast<float>());
  };
  for (std::uint32_t ring = 0; ring < rings; ++ring) {
    for (std::uint32_t i = 0; i < around; ++i) {
      add(onSphere(std::numbers::pi * (ring + 1) / (rings + 1), 2 * std::numbers::pi * i / around));
    }
  }
  add({0, 1, 0});
  add({0, -1, 0});
  const std::uint32_t top = rings * around;
  const auto at = [around](std::uint32_t ring, std::uint32_t i) { return ring * around + i % around; };
  for (std::uint32_t i = 0; i < around; ++i) {
    mesh.triangles.push_back({top, at(0, i + 1), at(0, i)});
    for (std::uint32_t ring = 0; ring + 1 < rings; ++ring) {
      mesh.triangles.push_back({at(ring, i), at(ring, i + 1), at(ring + 1, i)});
      mesh.triangles.push_back({at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i)});
    }
    mesh.triangles.push_back({top + 1, at(rings - 1, i), at(rings - 1, i + 1)});
  }
  return mesh;
}

const TriangleMesh& bumpyBall(std::size_t triangles) {
  static std::map<std::size_t, TriangleMesh> made;
  const auto [it, fresh] = made.try_emplace(triangles);
  if (fresh) it->second = makeBumpyBall(triangles);
  return it->second;
}

void tell(scene::SceneBuilder& builder, std::int32_t object, const TriangleMesh& mesh, base::Nanos now) {
  std::vector<scene::Notice> notices;
  const auto say = [&](scene::SceneCommand&& command) { builder.apply(1, std::move(command), now, notices); };
  say(scene::SetObjectNumber{object + 1});
  say(scene::SetSurfaceProperty{object, "stiffness", 0.5});
  say(scene::SetVertices{object, 0, mesh.vertices});
  say(scene::SetTriangles{object, 0, mesh.triangles, false});
}

std::shared_ptr<const scene::SceneSnapshot> sceneOf(const TriangleMesh& mesh) {
  scene::SceneConfig config;
  config.checkMeshes = false;
  scene::SceneBuilder builder(config);
  tell(builder, 0, mesh, 0);
  std::vector<scene::Notice> notices;
  return builder.publish(1'000'000'000, notices);
}

const char* nameOf(Act act) noexcept {
  return act == Act::contact ? "contact" : act == Act::slide ? "slide" : "tap";
}

Vec3 handAt(Act act, double t) {
  const Vec3 tremor(std::sin(2 * std::numbers::pi * 8.1 * t), std::sin(2 * std::numbers::pi * 9.7 * t),
                    std::sin(2 * std::numbers::pi * 11.3 * t));
  Vec3 n = onSphere(1.1, 0.7);
  double depth_mm = kPress_mm;
  if (act == Act::slide) n = slideDirection(t);
  if (act == Act::tap) {
    n = onSphere(1.3, 0.4 * t);
    depth_mm = kTap_mm * std::sin(2 * std::numbers::pi * 4 * t);
  }
  return ((ballSurface_mm(n) - depth_mm) * n + kTremor_mm * tremor) * 1e-3;
}

std::vector<HandTick> handOf(int rounds) {
  std::vector<HandTick> ticks;
  const int acts = 3 * rounds;
  for (int k = 0; k < acts; ++k) {
    const Act act = kActs[k % 3];
    for (int i = 0; i < kActTicks; ++i) ticks.push_back({act, handAt(act, (k / 3 * kActTicks + i) * 1e-3)});
    const int next = (k + 1) % acts;
    addWay(handAt(kActs[next % 3], next / 3 * kActTicks * 1e-3), ticks);
  }
  // From the air: a hand that begins inside a closed mesh stays inside.
  std::rotate(ticks.begin(), ticks.end() - kWayTicks / 2, ticks.end());
  return ticks;
}

}  // namespace hapticd::bench

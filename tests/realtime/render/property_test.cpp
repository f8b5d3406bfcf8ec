// Invariants for any scene and any motion of the HIP.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>
#include <optional>

#include "meshes.h"
#include "reduced.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

double random(double from, double to) {
  return from + (to - from) * *rc::gen::inRange(0, 1'000'000) * 1e-6;
}
Vec3 randomVec(double size) {
  return {random(-size, size), random(-size, size), random(-size, size)};
}

TriangleMesh randomSoup(int triangles) {
  TriangleMesh mesh;
  for (int i = 0; i < 12; ++i) mesh.vertices.push_back(randomVec(0.02).cast<float>());
  mesh.vertices.push_back(geometry::Vec3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  for (int i = 0; i < triangles; ++i) {
    const auto any = [] { return static_cast<std::uint32_t>(*rc::gen::inRange(0, 13)); };
    mesh.triangles.push_back({any(), any(), any()});
  }
  return mesh;
}

scene::Surface randomSurface() {
  scene::Surface s = surface(random(100, 3000), random(0, 2), 0);
  s.dynamicFriction = random(0, 1) * s.staticFriction;
  s.damping_Ns_per_m = random(0, 3);
  s.popthrough_N = *rc::gen::element(0.0, 1.0);
  return s;
}

// The force is finite and at most that of spring and damper.
void expectSane(const Rendering& r, const Vec3& hip, const Vec3& velocity, const scene::Surface& s) {
  RC_ASSERT(r.force_N.allFinite());
  RC_ASSERT(r.proxy_m.allFinite());
  RC_ASSERT((r.status & kRenderNotFinite) == 0U);
  const double damping = 3 * s.damping_Ns_per_m * velocity.norm() * (1 + s.staticFriction);
  RC_ASSERT(r.force_N.norm() <= s.stiffness_N_per_m * (hip - r.proxy_m).norm() * (1 + 1e-6) + damping + 1e-6);
}

RC_GTEST_PROP(RendererProperty, force_is_finite_and_bounded_by_spring_and_damper, ()) {
  SceneFixture fixture;
  fixture.faces = *rc::gen::element(scene::TouchableFaces::front, scene::TouchableFaces::back,
                                    scene::TouchableFaces::both);
  const scene::Surface s = randomSurface();
  fixture.add(randomSoup(*rc::gen::inRange(1, 60)), s);
  RenderOptions options;
  options.toolRadius_m = *rc::gen::element(0.0, 0.0, 0.002);
  Hand hand(fixture.snapshot(), options);
  Vec3 hip = randomVec(0.03);
  hand.at(hip);
  int all = 0;
  int unfinished = 0;
  for (int i = 0; i < 10; ++i) {
    const Vec3 goal = randomVec(0.02);
    const int ticks = *rc::gen::inRange(1, 50);
    for (int k = 0; k < ticks; ++k) {
      const Vec3 step = (goal - hip) / (ticks - k);
      hip += step;
      const Rendering& r = hand.at(hip);
      expectSane(r, hip, step / 1e-3, s);
      ++all;
      unfinished += (r.status & kRenderIterationLimit) != 0U ? 1 : 0;
    }
  }
  // A ball balanced on a corner may creep on for some ticks. A point arrives, but where dozens of triangles
  // run through each other at random it may once in a while need the next tick.
  RC_ASSERT(options.toolRadius_m > 0 || unfinished <= 1 + all / 20);
}

// A closed star-shaped mesh: a proxy that starts outside stays outside.
RC_GTEST_PROP(RendererProperty, proxy_never_gets_into_a_closed_mesh, ()) {
  TriangleMesh mesh = sphere(0.02, *rc::gen::inRange(1, 12));
  const double roughness = random(0, 0.3);
  for (auto& v : mesh.vertices) v *= static_cast<float>(1 + roughness * random(-1, 1));
  SceneFixture fixture;
  fixture.faces = *rc::gen::element(scene::TouchableFaces::front, scene::TouchableFaces::both);
  const double mu = random(0, 1);
  fixture.add(mesh, surface(1000, mu, 0.8 * mu));
  Hand hand(fixture.snapshot());
  // Inside the cone of the triangle that the ray from the centre meets, and below it.
  const auto inside = [&](const Vec3& p) {
    for (const auto& t : mesh.triangles) {
      const Vec3 a = mesh.vertices[t[0]].cast<double>();
      const Vec3 b = mesh.vertices[t[1]].cast<double>();
      const Vec3 c = mesh.vertices[t[2]].cast<double>();
      if (a.cross(b).dot(p) < 0 || b.cross(c).dot(p) < 0 || c.cross(a).dot(p) < 0) continue;
      if ((b - a).cross(c - a).dot(p - a) < 0) return true;
    }
    return false;
  };
  hand.at(Vec3(0, 0, 0.04));
  for (int i = 0; i < 6; ++i) {
    hand.to(randomVec(0.03), random(0.02, 2), [&](const Rendering& r) {
      RC_ASSERT(!inside(r.proxy_m));
      RC_ASSERT(r.force_N.norm() == 0 || (r.proxy_m - hand.hip()).norm() > 0);
    });
  }
}

// A rotated, translated and scaled scene gives the same force, rotated.
RC_GTEST_PROP(RendererProperty, force_does_not_depend_on_the_frame_or_the_unit, ()) {
  const TriangleMesh mesh = sphere(0.02, 9);
  const double mu = random(0, 1);
  SceneFixture plain;
  plain.add(mesh, surface(1000, mu, mu));
  const double units = *rc::gen::element(1.0, 1000.0, 39.37);
  const Eigen::AngleAxisd turn(random(0, 6), randomVec(1).stableNormalized());
  const Vec3 shift = randomVec(1);
  SceneFixture moved;
  moved.setWorldUnitsPerMetre(units);
  moved.add(mesh, surface(1000, mu, mu),
            Affine(Eigen::UniformScaling<double>(units) * Eigen::Translation3d(shift) * turn));
  const Vec3 start(0.001, 0.0005, 0.022);
  std::optional<Hand> first;
  std::optional<Hand> second;
  Vec3 hip = start;
  int differing = 0;
  for (int i = 0; i < reduced(400, 100); ++i) {
    if (!first) {
      first.emplace(plain.snapshot());
      second.emplace(moved.snapshot());
      hip = start;
    }
    hip = hip + 2e-5 * Vec3(random(-1, 1), random(-1, 1), random(-1, 1)) -
          1e-5 * (hip.norm() > 0.018) * hip / hip.norm();
    const Vec3 f = first->at(hip).force_N;
    const Vec3 g = second->at(shift + turn * hip).force_N;
    // Where a stick ends or an edge is crossed, rounding may decide the tick, and with it where the proxies
    // stick from there on: a new touch begins.
    if ((turn * f - g).norm() > 1e-4) {
      ++differing;
      first.reset();
    }
  }
  RC_ASSERT(differing <= 4);
}

}  // namespace
}  // namespace hapticd::realtime::fixture

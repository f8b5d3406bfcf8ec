// Surfaces that a client renders across a network of 20 ms each way.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "base/clock.h"
#include "base/time.h"
#include "bench/remote_loop.h"
#include "realtime/remote/remote_input.h"
#include "realtime/render/meshes.h"
#include "realtime/render/scene_fixture.h"
#include "realtime/servo/fakes.h"
#include "realtime/servo/tick.h"
#include "realtime/servo/wall.h"
#include "scene/surface.h"

namespace hapticd::realtime {
namespace {

bench::RemoteLoop badLine(bench::WallBy by) {
  bench::RemoteLoop loop;
  loop.by = by;
  loop.rate_Hz = 60;
  loop.jitter_s = 0.005;
  loop.delay_s = 0.020;
  loop.loss = 0.01;
  return loop;
}

TEST(RemoteLoop, streamed_wall_is_as_stiff_as_a_local_one) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    bench::RemoteLoop loop = badLine(bench::WallBy::remoteContact);
    loop.seed = seed;
    const bench::WallPress press = bench::pressWall(1000, loop);
    EXPECT_LT(press.peakToPeak_m, kSettled_m);
    EXPECT_NEAR(press.force_N, 1000 * 300 * 0.008 / 1300, 0.01) << "two springs in a row";
  }
}

TEST(RemoteLoop, held_force_does_not_settle_there_and_the_tank_calms_it) {
  const bench::WallPress raw = bench::pressWall(1000, badLine(bench::WallBy::heldForce));
  const bench::WallPress tanked = bench::pressWall(1000, badLine(bench::WallBy::tankedForce));
  EXPECT_GT(raw.peakToPeak_m, 0.01);
  EXPECT_LT(tanked.peakToPeak_m, 0.6 * raw.peakToPeak_m);
}

constexpr double kBall_m = 0.030;

scene::Surface ballSurface() {
  scene::Surface surface;
  surface.stiffness_N_per_m = 500;
  surface.staticFriction = 0.2;
  surface.dynamicFriction = 0.1;
  return surface;
}

// The contact of a client that knows the hand as it was 20 ms ago: the point of its sphere nearest to it.
RemoteContact ballContact(const Vec3& hand_m) {
  const scene::Surface surface = ballSurface();
  RemoteContact contact;
  contact.shape = RemoteShape::sphere;
  contact.radius_m = kBall_m;
  contact.normal = hand_m.normalized();
  contact.point_m = kBall_m * contact.normal;
  contact.stiffness_N_per_m = surface.stiffness_N_per_m;
  contact.staticFriction = surface.staticFriction;
  contact.dynamicFriction = surface.dynamicFriction;
  return contact;
}

// Slides over a quarter of the sphere at 60 mm/s, 2 mm below its surface; from 5 mm above it.
TEST(RemoteLoop, streamed_sphere_feels_as_the_mesh) {
  fixture::SceneFixture scene;
  scene.add(fixture::sphere(kBall_m, 40), ballSurface());
  const auto mesh = scene.snapshot();
  Renderer renderer;
  RemoteContacts remote;
  RemoteContactSet set;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> share(0, 1);
  Vec3 last = Vec3::Zero();
  int next = 0;
  std::vector<Vec3> path;
  for (int ms = 0; ms < 900; ++ms) {
    const double height = ms < 100 ? 0.005 - 0.00007 * ms : -0.002;
    const double angle = 0.06 / kBall_m * 1e-3 * ms;
    path.push_back((kBall_m + height) * Vec3(std::sin(angle), std::cos(angle), 0));
  }
  for (int ms = 1; ms < 900; ++ms) {
    const Nanos now = ms * 1'000'000LL;
    const Vec3& hip = path[static_cast<std::size_t>(ms)];
    if (ms >= next) {
      next = ms + 16 + static_cast<int>(10 * share(random) - 5);
      if (share(random) > 0.01) {
        ++set.number;
        set.received = set.stated = now;
        set.count = 1;
        set.contacts[0] = ballContact(path[static_cast<std::size_t>(std::max(0, ms - 40))]);
      }
    }
    device::DeviceState state;
    state.position_m = hip;
    state.velocity_m_per_s = (hip - path[static_cast<std::size_t>(ms - 1)]) * 1e3;
    Rendering rendering;
    renderer.step(*mesh, state, now, 1'000'000, rendering);
    RemoteRendering out;
    const Vec3 force = remote.step(set, {hip, state.velocity_m_per_s, {}}, now, 1e-3, out);
    EXPECT_LT((force - last).norm(), 0.3) << ms;
    if (ms > 150) {
      EXPECT_GT(rendering.force_N.norm(), 0.8);
      EXPECT_LT((force - rendering.force_N).norm(), 0.05 * rendering.force_N.norm()) << ms;
    }
    last = force;
  }
}

// The client sends nothing any more: the force is zero 100 ms after its last update, and falls to it without
// a step.
TEST(RemoteLoop, force_of_a_lost_client_is_zero_after_100_ms) {
  FakeDevice device;
  FakeClock clock;
  TickOptions options;
  options.guard = GuardOptions::of(device.profile());
  options.guard.rampIn = 0;
  Tick tick(device, clock, options);
  RemoteInput input;
  Nanos now = 0;
  const auto step = [&] {
    tick(now += 1'000'000);
    tick.reports().consume([](const TickReport&) {});
    return tick.last().force_N.y();
  };
  for (int ms = 0; ms < 200; ++ms) {
    device.state.position_m.y() = std::max(-0.003, 0.001 - 0.00005 * ms);
    if (ms % 16 == 0) {
      ++input.contacts.number;
      input.contacts.received = input.contacts.stated = now;
      input.contacts.count = 1;
      input.contacts.contacts[0].stiffness_N_per_m = 1000;
      tick.remote().write(input);
    }
    step();
  }
  const Nanos lastUpdate = input.contacts.received;
  double last = tick.last().force_N.y();
  ASSERT_NEAR(last, 3, 1e-6);
  while (now < lastUpdate + 100'000'000) {
    const double force = step();
    EXPECT_LE(std::abs(force - last), 0.3);
    last = force;
  }
  EXPECT_EQ(last, 0);
}

// An arm that nobody holds above a floor that a client states at 60 Hz.
class ArmOnRemoteFloor {
 public:
  Vec3 x_m = Vec3(0.001, 0.004, 0.001);
  Vec3 v_m_per_s = Vec3::Zero();
  double mass_kg = 0.1;
  double damping_Ns_per_m = 0.1;
  double coulomb_N = 0;
  double weight_N = 0;
  int every_ms = 16;         // the client states the floor
  bool beside = false;       // and another surface, which moves and which nobody touches
  double rises_m_per_s = 0;  // the floor, from 1 s on

  ArmOnRemoteFloor(double stiffness_N_per_m, double bareDamping_Ns_per_m)
      : stiffness_(stiffness_N_per_m), tick_(device_, clock_, options(bareDamping_Ns_per_m)) {}

  const TickReport& last() const { return tick_.last(); }
  void step() {
    constexpr int kParts = 20;
    constexpr double kPart_s = 1e-3 / kParts;
    if (ms_ % every_ms == 0) state();
    ++ms_;
    device_.state.position_m = x_m;
    device_.state.velocity_m_per_s = v_m_per_s;
    tick_(now());
    tick_.reports().consume([](const TickReport&) {});
    for (int i = 0; i < kParts; ++i) {
      Vec3 force = tick_.last().force_N - Vec3(0, weight_N, 0) - damping_Ns_per_m * v_m_per_s;
      const double speed = v_m_per_s.norm();
      if (speed > 0) force -= std::min(coulomb_N, speed * mass_kg / kPart_s) / speed * v_m_per_s;
      v_m_per_s += kPart_s / mass_kg * force;
      x_m += kPart_s * v_m_per_s;
    }
  }

 private:
  TickOptions options(double bareDamping_Ns_per_m) const {
    TickOptions options;
    options.guard = GuardOptions::of(device_.profile());
    options.guard.rampIn = 0;
    options.guard.peakForce_N = options.guard.continuousForce_N = 20;
    options.render.bareDamping_Ns_per_m = bareDamping_Ns_per_m;
    return options;
  }
  Nanos now() const { return (1000 + ms_) * 1'000'000LL; }
  void state() {
    ++input_.contacts.number;
    input_.contacts.received = input_.contacts.stated = now();
    input_.contacts.count = beside ? 2 : 1;
    const double risen_m = 1e-3 * rises_m_per_s * static_cast<double>(std::max(0LL, ms_ - 1000));
    RemoteContact& floor = input_.contacts.contacts[0];
    floor.stiffness_N_per_m = stiffness_;
    floor.point_m.y() = static_cast<float>(risen_m + 6e-9 * (ms_ % 2));  // rounded as clients do
    if (ms_ >= 1000) floor.velocity_m_per_s.y() = rises_m_per_s;
    RemoteContact& wall = input_.contacts.contacts[1];
    wall.id = 1;
    wall.normal = Vec3::UnitX();
    wall.point_m.x() = -0.03 + 1e-5 * static_cast<double>(ms_ % 100);
    wall.stiffness_N_per_m = stiffness_;
    tick_.remote().write(input_);
  }

  double stiffness_;
  FakeDevice device_;
  FakeClock clock_;
  Tick tick_;
  RemoteInput input_;
  long long ms_ = 0;
};

TEST(RemotePassivity, arm_that_is_let_go_comes_to_rest) {
  for (const double stiffness : {300.0, 1000.0, 1766.0}) {
    for (const auto& [mass_kg, every_ms] : {std::pair{0.05, 16}, {0.1, 16}, {0.2, 16}, {0.1, 1}, {0.1, 4}}) {
      ArmOnRemoteFloor arm(stiffness, 0.1);
      arm.every_ms = every_ms;
      arm.beside = every_ms < 16;
      arm.mass_kg = mass_kg;
      arm.weight_N = 0.5;
      arm.coulomb_N = 0.02;
      for (int ms = 0; ms < 5000; ++ms) arm.step();
      double lowest = arm.x_m.y();
      double highest = lowest;
      for (int ms = 0; ms < 1000; ++ms) {
        arm.step();
        lowest = std::min(lowest, arm.x_m.y());
        highest = std::max(highest, arm.x_m.y());
      }
      EXPECT_LT(highest - lowest, 1e-4)
          << stiffness << " N/m, " << mass_kg << " kg, every " << every_ms << " ms";
      EXPECT_NEAR(highest, -0.5 / stiffness, 1e-4);
    }
  }
}

// What moves is not lowered.
TEST(RemotePassivity, floor_that_rises_quickly_keeps_its_stiffness) {
  ArmOnRemoteFloor arm(5000, std::numeric_limits<double>::infinity());
  arm.mass_kg = 1e6;
  arm.x_m.y() = -0.0005;
  for (int ms = 0; ms < 900; ++ms) arm.step();
  arm.rises_m_per_s = 0.3;
  for (int ms = 0; ms < 112; ++ms) arm.step();
  const RemoteRendering& remote = arm.last().remote;
  ASSERT_EQ(remote.count, 1U);
  EXPECT_GT(remote.contacts[0].depth_m, 0.001F);
  EXPECT_NEAR(remote.contactForce_N.y(), 5000.0 * static_cast<double>(remote.contacts[0].depth_m), 1e-3);
}

// The guard would let the force through late: little on the way in, all of it on the way out.
TEST(RemotePassivity, hard_floor_does_not_throw_a_fast_arm_back_faster) {
  for (const double stiffness : {1000.0, 3000.0, 5000.0}) {
    for (const double speed : {0.3, 0.5, 0.8, 1.0}) {
      ArmOnRemoteFloor arm(stiffness, std::numeric_limits<double>::infinity());
      arm.damping_Ns_per_m = 0.3;
      for (int ms = 0; ms < 50; ++ms) arm.step();
      arm.x_m = Vec3(0.001, 0.020, 0.001);
      arm.v_m_per_s = Vec3(0, -speed, 0);
      double in_m_per_s = 0;
      while (arm.x_m.y() > 0) {
        in_m_per_s = -arm.v_m_per_s.y();
        arm.step();
      }
      for (int ms = 0; ms < 300 && arm.x_m.y() <= 0; ++ms) arm.step();
      EXPECT_GT(arm.v_m_per_s.y(), 0);
      EXPECT_LT(arm.v_m_per_s.y(), 1.15 * in_m_per_s) << stiffness << " N/m, " << speed << " m/s";
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime

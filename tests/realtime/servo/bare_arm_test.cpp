// An arm that nobody holds comes to rest on surfaces, and the controller that brakes it brakes nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/time.h"
#include "realtime/render/meshes.h"
#include "realtime/render/renderer.h"
#include "realtime/render/scene_fixture.h"
#include "realtime/servo/fakes.h"
#include "realtime/servo/tick.h"
#include "realtime/servo/wall.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {
namespace {

// In code that shares nothing with the renderer or the simulated hand: a mass with viscous and Coulomb
// friction, an encoder, and a constant pull into the wall. It is let go at the surface.
struct BareArm {
  double mass_kg = 0.1;
  double damping_Ns_per_m = 0.1;
  double coulomb_N = 0.05;
  double encoder_m = 55e-6;
  double pull_N = 1;

  double y = 0;
  double speed = 0;

  double measured() const { return std::round(y / encoder_m) * encoder_m; }
  void move(double force_N, double period_s) {
    constexpr int kSteps = 100;
    const double step_s = period_s / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const double drive = force_N - pull_N - damping_Ns_per_m * speed;
      if (speed == 0 && std::abs(drive) <= coulomb_N) return;
      const double against = speed != 0 ? std::copysign(coulomb_N, speed) : std::copysign(coulomb_N, drive);
      const double next = speed + step_s * (drive - against) / mass_kg;
      speed = next * speed < 0 ? 0 : next;
      y += step_s * speed;
    }
  }
};

constexpr double kNeverHelps = std::numeric_limits<double>::infinity();

struct LetGo {
  double peakToPeak_m = 0;  // one second after it was let go, for 0.3 s
  double rest_m = 0;
};

struct Loop {
  double rate_Hz = 1000;
  int repeat = 1;  // ticks for each measurement of the device
  double drop_m = 0;
  double settle_s = 1;
  double tremble_m = 0;  // sideways, of an object instead of the wall, at 60 Hz
  RenderOptions render;
};

// To the other side of its place, as a stream of poses with noise.
void tremble(scene::ObjectState& object, double by_m, Nanos now) {
  const geometry::Affine before = object.motion.at(now);
  geometry::Affine to = geometry::Affine::Identity();
  to.translation().x() = before.translation().x() > 0 ? -by_m : by_m;
  object.motion = scene::Motion::between(before, to, now, now + 16'000'000);
}

// The same arm against a wall, without guard.
LetGo letGo(BareArm arm, double stiffness_N_per_m, const Loop& loop) {
  auto scene = wall(stiff(stiffness_N_per_m));
  auto last = scene;  // with which the next tick compares it
  fixture::SceneFixture built;
  scene::ObjectState& floor =
      built.add(fixture::geometryOf(fixture::box({-1, -1, -1}, {1, 0, 1}), 1), stiff(stiffness_N_per_m));
  Renderer renderer(loop.render);
  Rendering rendering;
  device::DeviceState state;
  const double period_s = 1 / loop.rate_Hz;
  const Nanos period = base::toNanos(period_s);
  const int end = static_cast<int>((loop.settle_s + 0.3) * loop.rate_Hz);
  double lowest = 1;
  double highest = -1;
  arm.y = loop.drop_m;
  for (int i = 0; i < end; ++i) {
    if (i % loop.repeat == 0) {
      const Vec3 before = state.position_m;
      state.position_m.y() = arm.measured();
      state.velocity_m_per_s = (state.position_m - before) / (loop.repeat * period_s);
    }
    state.time = i * period;
    if (loop.tremble_m > 0 && i % static_cast<int>(loop.rate_Hz / 60) == 0) {
      tremble(floor, loop.tremble_m, state.time);
      last = std::exchange(scene, built.snapshot());
    }
    renderer.step(*scene, state, state.time, period, rendering);
    arm.move(rendering.force_N.y(), period_s);
    if (i < loop.settle_s * loop.rate_Hz) continue;
    lowest = std::min(lowest, arm.y);
    highest = std::max(highest, arm.y);
  }
  return {highest - lowest, arm.y};
}

LetGo letGo(BareArm arm, double stiffness_N_per_m, double bareDamping_Ns_per_m) {
  return letGo(arm, stiffness_N_per_m, Loop{.render = {.bareDamping_Ns_per_m = bareDamping_Ns_per_m}});
}

TEST(BareArmTest, bounces_on_a_stiff_wall_without_the_controller) {
  EXPECT_GT(letGo({}, 3500, kNeverHelps).peakToPeak_m, 1e-3);
  EXPECT_GT(letGo({.mass_kg = 0.05, .damping_Ns_per_m = 0.05}, 2000, kNeverHelps).peakToPeak_m, 1e-3);
}

// A light spring takes longer than a second to come to rest by itself under a heavy arm with little friction.
// The wall gives no energy there, so the controller has nothing to take: from 500 N/m on, all rest.
TEST(BareArmTest, comes_to_rest_within_a_second) {
  for (const double mass : {0.05, 0.1, 0.2, 0.3}) {
    for (const double damping : {0.05, 0.1, 0.3, 1.0}) {
      for (const double stiffness : {500.0, 1000.0, 2000.0, 3500.0, 5000.0}) {
        const BareArm arm{.mass_kg = mass, .damping_Ns_per_m = damping};
        const LetGo end = letGo(arm, stiffness, damping);
        EXPECT_LT(end.peakToPeak_m, 100e-6)
            << mass << " kg, " << damping << " N s/m, " << stiffness << " N/m";
        // The pull, within friction and the step of the encoder.
        EXPECT_NEAR(end.rest_m, -1 / stiffness, 0.06 / stiffness + 2 * arm.encoder_m);
      }
    }
  }
}

TEST(BareArmTest, soft_walls_are_no_worse_than_without_the_controller) {
  for (const double mass : {0.05, 0.1, 0.2, 0.3}) {
    for (const double stiffness : {100.0, 200.0}) {
      const BareArm arm{.mass_kg = mass, .damping_Ns_per_m = 0.05};
      EXPECT_LE(letGo(arm, stiffness, 0.05).peakToPeak_m,
                letGo(arm, stiffness, kNeverHelps).peakToPeak_m + 1e-6);
    }
  }
}

// Poses that a physics engine sends for what lies still.
TEST(BareArmTest, comes_to_rest_on_what_trembles_sideways) {
  for (const double tremble_m : {1e-7, 1e-5}) {
    for (const double stiffness : {500.0, 1000.0}) {
      Loop loop{
          .drop_m = 0.003, .settle_s = 5, .tremble_m = tremble_m, .render = {.bareDamping_Ns_per_m = 0.1}};
      EXPECT_LT(letGo({.coulomb_N = 0.02}, stiffness, loop).peakToPeak_m, 100e-6)
          << tremble_m << " m, " << stiffness << " N/m";
    }
  }
}

// Drivers may deliver each position for several ticks: the account is that of a loop at their own rate.
TEST(BareArmTest, comes_to_rest_when_the_device_repeats_its_positions) {
  for (const int repeat : {2, 3, 4, 5}) {
    for (const double stiffness : {500.0, 1000.0}) {
      for (const double mass : {0.05, 0.1}) {
        Loop loop{.repeat = repeat, .drop_m = 0.001, .settle_s = 5, .render = {.bareDamping_Ns_per_m = 0.1}};
        EXPECT_LT(letGo({.mass_kg = mass}, stiffness, loop).peakToPeak_m, 100e-6)
            << repeat << " ticks, " << stiffness << " N/m, " << mass << " kg";
        loop.render.bareDamping_Ns_per_m = kNeverHelps;
        EXPECT_GT(letGo({.mass_kg = mass}, stiffness, loop).peakToPeak_m, repeat > 2 ? 0.02 : 0) << repeat;
      }
    }
  }
}

// A slow loop sees the first and the last part of a contact a tick late: both are booked.
TEST(BareArmTest, comes_to_rest_after_a_drop_at_any_rate) {
  for (const double rate : {250.0, 500.0, 1000.0, 4000.0}) {
    for (const double stiffness : {500.0, 1000.0}) {
      for (const double damping : {0.05, 0.1}) {
        for (const double drop : {0.001, 0.003}) {
          const BareArm arm{.mass_kg = 0.05, .damping_Ns_per_m = damping, .pull_N = 2};
          const Loop loop{
              .rate_Hz = rate, .drop_m = drop, .settle_s = 5, .render = {.bareDamping_Ns_per_m = damping}};
          EXPECT_LT(letGo(arm, stiffness, loop).peakToPeak_m, 100e-6)
              << rate << " Hz, " << stiffness << " N/m, " << damping << " N s/m, " << drop << " m";
        }
      }
    }
  }
}

// An arm that flies onto a wall through the whole servo: how much faster it leaves than it came.
struct Tap {
  double speedRatio = 0;
  double most_N = 0;
};

Tap tap(double stiffness_N_per_m, double speed_m_per_s, double damping_Ns_per_m, double bareDamping_Ns_per_m,
        bool guarded) {
  FakeDevice device;
  FakeClock clock;
  TickOptions options;
  options.render.bareDamping_Ns_per_m = bareDamping_Ns_per_m;
  options.guard.enabled = guarded;
  options.guard.armed = true;
  options.guard.peakForce_N = options.guard.continuousForce_N = 20;
  Tick tick(device, clock, options);
  tick.snapshots().publish(wall(stiff(stiffness_N_per_m)));
  BareArm arm{.mass_kg = 0.1, .damping_Ns_per_m = damping_Ns_per_m, .coulomb_N = 0, .encoder_m = 20e-6};
  arm.pull_N = 0;
  arm.y = 0.002;
  Nanos now = 0;
  const auto step = [&] {
    const double before = device.state.position_m.y();
    device.state.position_m.y() = arm.measured();
    device.state.velocity_m_per_s.y() = (arm.measured() - before) / 1e-3;
    tick(now += fixture::kTick);
    tick.reports().consume([](const TickReport&) {});
  };
  for (int i = 0; i < 600; ++i) step();  // the guard ramps in
  Tap result;
  arm.speed = -speed_m_per_s;
  double in = 0;
  for (int i = 0; i < 400; ++i) {
    step();
    if (tick.last().rendering.touching && in == 0) in = -arm.speed;
    if (in > 0 && arm.speed > 0 && !tick.last().rendering.touching) break;
    result.most_N = std::max(result.most_N, device.written_N.norm());
    arm.move(device.written_N.y(), 1e-3);
  }
  result.speedRatio = arm.speed / in;
  return result;
}

// The guard lets a force grow by 1 N/ms and fall at once. A hit that outruns it must not be late: the wall
// would take little and give all of its spring.
TEST(BareArmTest, no_hit_is_thrown_back_by_the_slew_limit) {
  for (const double bareDamping : {0.3, kNeverHelps}) {
    for (const double stiffness : {2000.0, 5000.0, 8000.0}) {
      for (const double damping : {0.3, 3.0}) {
        for (const double speed : {0.1, 0.2, 0.5, 1.0}) {
          const Tap raw = tap(stiffness, speed, damping, bareDamping, false);
          const Tap guarded = tap(stiffness, speed, damping, bareDamping, true);
          EXPECT_LE(guarded.speedRatio, std::max(1.02, raw.speedRatio + 0.02))
              << stiffness << " N/m, " << speed << " m/s, " << damping << " N s/m, controller "
              << bareDamping;
          EXPECT_GT(guarded.most_N, 0.3 * std::min(20.0, speed * std::sqrt(0.1 * stiffness)))
              << "a wall all the same";
        }
      }
    }
  }
}

// What was lowered for a hit returns while the hand presses.
TEST(BareArmTest, a_wall_that_was_hit_is_as_stiff_as_ever_after_a_second) {
  FakeDevice device;
  FakeClock clock;
  TickOptions options;
  options.guard.armed = true;
  options.guard.peakForce_N = options.guard.continuousForce_N = 30;
  Tick tick(device, clock, options);
  tick.snapshots().publish(wall(stiff(5000)));
  Nanos now = 0;
  const auto to = [&](double y, int ticks) {
    const double from = device.state.position_m.y();
    for (int i = 1; i <= ticks; ++i) {
      device.state.position_m.y() = from + (y - from) * i / ticks;
      tick(now += fixture::kTick);
      tick.reports().consume([](const TickReport&) {});
    }
    return device.written_N.y();
  };
  to(0.004, 600);
  EXPECT_NEAR(to(-0.004, 16), 8, 1) << "0.5 m/s: a spring of 2000 N/m";
  double last = device.written_N.y();
  for (int i = 0; i < 1000; ++i) {
    const double force = to(-0.004, 1);
    EXPECT_GE(force, last - 1e-9);
    EXPECT_LE(force, last + 0.021) << "a thousandth of the whole force each tick";
    last = force;
  }
  EXPECT_NEAR(last, 20, 1e-6);
}

// An arm without Coulomb friction falls into a groove between two surfaces; their stiffness is one field.
double leftInGroove(double angle, double left_N_per_m, double right_N_per_m, double mass_kg) {
  fixture::SceneFixture built;
  built.faces = scene::TouchableFaces::both;
  for (const double side : {-1.0, 1.0}) {
    const Vec3 up = 0.04 * Vec3(side * std::cos(angle), std::sin(angle), 0);
    geometry::TriangleMesh wall;
    for (const Vec3& corner :
         {Vec3(0, 0, -0.03), Vec3(Vec3(0, 0, -0.03) + up), Vec3(0, 0, 0.03), Vec3(Vec3(0, 0, 0.03) + up)})
      wall.vertices.push_back(corner.cast<float>());
    wall.triangles = {{0, 1, 2}, {1, 3, 2}};
    built.add(wall, fixture::surface(side < 0 ? left_N_per_m : right_N_per_m));
  }
  constexpr double kDamping = 0.2;
  const BareArm still{.mass_kg = mass_kg, .damping_Ns_per_m = kDamping, .coulomb_N = 0, .encoder_m = 5e-6};
  BareArm x = still;
  BareArm y = still;
  x.pull_N = 0;
  x.y = 0.002;
  y.y = 0.010;
  fixture::Hand hand(built.snapshot(), {.bareDamping_Ns_per_m = kDamping});
  double lowest = 1;
  double highest = -1;
  for (int i = 0; i < 16'000; ++i) {
    const Vec3 force = hand.at({x.measured(), y.measured(), 0.001}).force_N;
    x.move(force.x(), 1e-3);
    y.move(force.y(), 1e-3);
    if (i < 15'000) continue;
    lowest = std::min(lowest, x.y);
    highest = std::max(highest, x.y);
  }
  return highest - lowest;
}

TEST(BareArmTest, comes_to_rest_between_surfaces_of_unequal_stiffness) {
  for (const double angle : {0.3, 0.5}) {
    for (const double stiff : {1100.0, 3000.0}) {
      for (const double mass : {0.06, 0.09})
        EXPECT_LT(leftInGroove(angle, 500, stiff, mass), 1e-3) << angle << ' ' << stiff << ' ' << mass;
    }
  }
}

// A profile that credits less damping than the arm has is safe.
TEST(BareArmTest, a_cautious_profile_suffices) {
  for (const double stiffness : {500.0, 2000.0, 5000.0})
    EXPECT_LT(letGo({.damping_Ns_per_m = 0.3}, stiffness, 0.05).peakToPeak_m, 100e-6) << stiffness;
}

// The same hand in the same scene, with and without the controller. True when every force has the same bytes.
bool sameForces(const std::shared_ptr<const scene::SceneSnapshot>& scene, double bareDamping_Ns_per_m,
                double speed_m_per_s) {
  fixture::Hand plain(scene);
  fixture::Hand guarded(scene, {.bareDamping_Ns_per_m = bareDamping_Ns_per_m});
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-0.012, 0.012);
  bool touched = false;
  plain.at({0, 0, 0.045});
  guarded.at({0, 0, 0.045});
  for (int k = 0; k < 60; ++k) {
    const Vec3 goal(place(random), place(random), 0.031 + 0.2 * place(random));
    std::vector<Vec3> forces;
    plain.to(goal, speed_m_per_s, [&](const Rendering& r) { forces.push_back(r.force_N); });
    std::size_t i = 0;
    bool same = true;
    guarded.to(goal, speed_m_per_s, [&](const Rendering& r) {
      same = same && r.force_N == forces[i++];
      touched = touched || r.touching;
    });
    if (!same) return false;
  }
  return touched;
}

std::shared_ptr<const scene::SceneSnapshot> ball(double friction, double speed_m_per_s) {
  fixture::SceneFixture built;
  built.setWorldUnitsPerMetre(1);
  geometry::Affine later = geometry::Affine::Identity();
  later.translation().z() = 60 * speed_m_per_s;
  built.add(fixture::geometryOf(fixture::sphere(0.03, 24), 1),
            fixture::surface(1000, friction, 0.7 * friction),
            speed_m_per_s > 0 ? scene::Motion::between(geometry::Affine::Identity(), later, 0, 60'000'000'000)
                              : scene::Motion::fixed(geometry::Affine::Identity()));
  return built.snapshot();
}

// 5 N s/m: the simulated hand's own. K T / 2 is a tenth of it: no path gains energy, however fast.
TEST(PassivityControl, adds_nothing_where_the_arm_dissipates_what_the_wall_gives) {
  for (const double friction : {0.0, 0.5}) {
    for (const double speed : {0.01, 0.1, 1.0})
      EXPECT_TRUE(sameForces(ball(friction, 0), kHandDamping, speed)) << friction << ' ' << speed;
  }
}

TEST(PassivityControl, brakes_an_arm_with_little_friction) {
  EXPECT_FALSE(sameForces(ball(0, 0), 0.05, 0.1));
}

TEST(PassivityControl, never_brakes_on_what_moves_unless_it_creeps) {
  EXPECT_TRUE(sameForces(ball(0, 4e-3), 0.0, 0.1));
  EXPECT_FALSE(sameForces(ball(0, 0.1e-3), 0.0, 0.1));
}

// Effects and fields are no part of the account.
TEST(PassivityControl, leaves_vibrations_and_fields_alone) {
  fixture::SceneFixture built;
  scene::Effect vibration;
  vibration.type = scene::EffectType::motorVibration;
  vibration.magnitude_N = 1;
  vibration.angularFrequency_rad_per_s = 600;
  built.effects = {vibration};
  fixture::Hand plain(built.snapshot());
  fixture::Hand controlled(built.snapshot(), {.bareDamping_Ns_per_m = 0});
  for (int i = 0; i < 200; ++i) {
    const Vec3 at(1e-4 * i, 0, 0);
    const Vec3 force = plain.at(at).force_N;
    EXPECT_EQ(controlled.at(at).force_N, force);
    EXPECT_GT(force.norm(), 0.5);
  }
}

// A hand that bounces in and out and to and fro, without an arm that yields.
TEST(PassivityControl, never_makes_a_surface_pull) {
  for (const double friction : {0.0, 0.6}) {
    for (const double vibration_N : {0.0, 2.0}) {
      fixture::SceneFixture built;
      built.add(fixture::sphere(0.03, 24), fixture::surface(4000, friction, friction));
      scene::Effect vibration;
      vibration.type = scene::EffectType::contactVibration;
      vibration.magnitude_N = vibration_N;
      vibration.angularFrequency_rad_per_s = 900;
      vibration.start = 1;
      built.effects = {vibration};
      fixture::Hand hand(built.snapshot(), {.bareDamping_Ns_per_m = 0});
      double lowest_N = 0;
      double brake_N = 0;
      for (int i = 0; i < 3000; ++i) {
        const double t = 1e-3 * i;
        const Rendering& r =
            hand.at({0.004 * std::sin(53 * t), 0.002 * std::sin(31 * t), 0.0296 + 0.001 * std::cos(611 * t)});
        if (!r.touching) continue;
        lowest_N = std::min(lowest_N, r.force_N.dot(r.normal));
        if (vibration_N == 0) brake_N = std::max(brake_N, (r.force_N - r.contactForce_N).norm());
      }
      EXPECT_GE(lowest_N, -1e-12) << friction << ' ' << vibration_N;
      if (vibration_N == 0) {
        EXPECT_GT(brake_N, 0.5);
      }
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime

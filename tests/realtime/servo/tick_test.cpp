// One tick with a scripted device: its calls, their order, and its report.
#include "realtime/servo/tick.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/fake_world.h"
#include "realtime/render/meshes.h"
#include "realtime/render/scene_fixture.h"
#include "realtime/servo/fakes.h"
#include "realtime/servo/watchdog.h"
#include "support/milliseconds.h"

namespace hapticd::realtime {
namespace {

TickOptions armed() {
  TickOptions options;
  options.guard.armed = true;
  return options;
}

class TickTest : public testing::Test {
 protected:
  // Runs ticks on time and returns the last report.
  const TickReport& run(Nanos duration) {
    for (Nanos t = 0; t < duration; t += kMs) tick(now_ += kMs);
    return tick.last();
  }
  const TickReport& runLate(Nanos late) {
    now_ += kMs + late;
    tick(Pacing{now_, late, 1, 0});
    return tick.last();
  }

  FakeDevice device;
  FakeClock clock;
  Tick tick{device, clock, armed()};
  Nanos now_ = 0;
};

TEST_F(TickTest, RendersNothingBeforeTheFirstSnapshot) {
  const TickReport& report = run(5 * kMs);
  EXPECT_EQ(report.revision, 0U);
  EXPECT_EQ(report.tick, 5U);
  EXPECT_EQ(report.force_N, Vec3::Zero());
  EXPECT_EQ(device.reads, 5);
  EXPECT_EQ(device.writes, 5);
}

TEST_F(TickTest, TheForceLeavesBeforeTheReport) {
  struct Look {
    Tick* tick;
    bool reported = false;
    bool woken = false;
  } look{&tick};
  device.context = &look;
  device.onWrite = [](void* context) {
    auto* l = static_cast<Look*>(context);
    l->reported |= l->tick->reports().consume([](const TickReport&) {}) > 0;
    l->woken |= l->tick->wake().drain();
  };
  run(kMs);
  EXPECT_FALSE(look.reported);
  EXPECT_FALSE(look.woken);
  EXPECT_TRUE(tick.wake().drain());
  EXPECT_FALSE(tick.wake().drain());
  EXPECT_EQ(tick.reports().consume([](const TickReport&) {}), 1U);
}

TEST_F(TickTest, ReportsWhatWasWritten) {
  tick.snapshots().publish(constantForce(7, Vec3(0, 30, 0)));
  device.state.position_m = Vec3(0.01, 0.02, 0.03);
  device.state.buttons = 2;
  const TickReport& report = run(1000 * kMs);
  EXPECT_EQ(report.revision, 7U);
  EXPECT_NEAR(report.rendering.force_N.y(), 30, 1e-9);
  EXPECT_NEAR(report.force_N.y(), 3.3, 1e-9);
  EXPECT_EQ(report.force_N, device.written_N);
  EXPECT_NE(report.guard.active & bit(Trip::peakForce), 0U);
  EXPECT_EQ(report.device.position_m, device.state.position_m);
  EXPECT_EQ(report.device.buttons, 2U);
  EXPECT_EQ(report.time, 1000 * kMs);
  EXPECT_EQ(report.timing.period, kMs);
  EXPECT_TRUE(report.guard.armed);
  EXPECT_FALSE(report.guard.stopped);
  EXPECT_NEAR((report.T_world_device * Vec3(1, 0, 0)).x(), 1000, 1e-9);
}

TEST_F(TickTest, TakesTheNewestSnapshot) {
  tick.snapshots().publish(constantForce(1, Vec3(0, 1, 0)));
  EXPECT_EQ(run(kMs).revision, 1U);
  tick.snapshots().publish(constantForce(2, Vec3(0, 1, 0)));
  tick.snapshots().publish(constantForce(3, Vec3(0, 1, 0)));
  EXPECT_EQ(run(kMs).revision, 3U);
}

TEST_F(TickTest, AStopIsZeroInTheNextTick) {
  tick.snapshots().publish(constantForce(1, Vec3(0, 3, 0)));
  EXPECT_NEAR(run(1000 * kMs).force_N.y(), 3, 1e-9);
  tick.control().stop();
  EXPECT_EQ(run(kMs).force_N, Vec3::Zero());
  EXPECT_EQ(device.written_N, Vec3::Zero());
  EXPECT_TRUE(tick.last().guard.stopped);
  tick.control().rearm();
  EXPECT_NEAR(run(1000 * kMs).force_N.y(), 3, 1e-9);
}

TEST_F(TickTest, ADeviceThatGivesNothingGetsNoForce) {
  tick.snapshots().publish(constantForce(1, Vec3(0, 3, 0)));
  run(1000 * kMs);
  device.gives = false;
  EXPECT_EQ(run(kMs).force_N, Vec3::Zero());
  device.gives = true;
  run(1000 * kMs);
  device.takes = false;
  run(kMs);
  EXPECT_EQ(run(kMs).force_N, Vec3::Zero()) << "the tick after a refused write";
}

TEST_F(TickTest, APositionThatIsNotANumberGetsNoForce) {
  tick.snapshots().publish(constantForce(1, Vec3(0, 3, 0)));
  run(1000 * kMs);
  device.state.position_m.y() = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 10; ++i) ASSERT_EQ(run(kMs).force_N, Vec3::Zero());
  device.state.position_m.y() = 0;
  EXPECT_NEAR(run(1000 * kMs).force_N.y(), 3, 1e-9);
}

// The renderer has set the force to zero by then.
TEST_F(TickTest, AnOrientationThatIsNotANumberTripsAndForcesRampIn) {
  tick.snapshots().publish(constantForce(7, Vec3(0, 2, 0)));
  EXPECT_NEAR(run(1000 * kMs).force_N.y(), 2, 1e-9);
  const Eigen::Quaterniond orientation = device.state.orientation;
  device.state.orientation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(run(kMs).force_N, Vec3::Zero());
  EXPECT_NE(tick.last().guard.active & bit(Trip::notFinite), 0U);
  device.state.orientation = orientation;
  run(kMs);
  EXPECT_EQ(tick.last().guard.active & bit(Trip::notFinite), 0U);
  EXPECT_NEAR(run(250 * kMs).force_N.y(), 1, 0.02);
}

TEST_F(TickTest, ALatePacerAndALongPeriodAreBothLate) {
  tick.snapshots().publish(constantForce(1, Vec3(0, 3, 0)));
  run(1000 * kMs);
  EXPECT_NE(runLate(4 * kMs).guard.active & bit(Trip::late), 0U);
  run(1000 * kMs);
  now_ += 4 * kMs;  // a callback that nobody paces
  EXPECT_NE(run(kMs).guard.active & bit(Trip::late), 0U);
  EXPECT_EQ(tick.last().guard.counts[static_cast<std::size_t>(Trip::late)], 2U);
}

TEST_F(TickTest, AFullRingCountsDropsAndTheLoopGoesOn) {
  const std::size_t capacity = tick.reports().capacity();
  run(static_cast<Nanos>(capacity + 10) * kMs);
  EXPECT_EQ(tick.last().dropped, 9U);
  std::uint64_t expected = 0;
  tick.reports().consume([&](const TickReport& report) { EXPECT_EQ(report.tick, ++expected); });
  EXPECT_EQ(expected, capacity);
}

TEST_F(TickTest, TheBlackBoxKeepsTheTwoSecondsBeforeAFault) {
  tick.snapshots().publish(constantForce(1, Vec3(0, 3, 0)));
  run(3000 * kMs);
  EXPECT_TRUE(tick.blackBox().take().empty());
  runLate(60 * kMs);
  run(100 * kMs);
  ASSERT_TRUE(tick.blackBox().frozen());
  const std::vector<TickReport> story = tick.blackBox().take();
  ASSERT_EQ(story.size(), 2000U);
  EXPECT_NE(story.back().guard.latched & bit(Trip::stalled), 0U);
  EXPECT_EQ(story.back().tick, 3001U);
  for (std::size_t i = 1; i < story.size(); ++i) ASSERT_EQ(story[i].tick, story[i - 1].tick + 1);
  EXPECT_FALSE(tick.blackBox().frozen());
}

TEST_F(TickTest, MeasuresItself) {
  run(100 * kMs);
  runLate(2 * kMs);
  EXPECT_EQ(tick.histograms().period.copy().total, 100U);
  EXPECT_EQ(tick.histograms().period.copy().max, 3 * kMs);
  EXPECT_EQ(tick.histograms().wakeupError.copy().max, 2 * kMs);
  EXPECT_EQ(tick.histograms().compute.copy().total, 101U);
  EXPECT_EQ(tick.last().timing.wakeupError, 2 * kMs);
  EXPECT_EQ(tick.last().timing.overruns, 1U);
}

TEST_F(TickTest, LeavesNoForceBehind) {
  tick.snapshots().publish(constantForce(1, Vec3(0, 3, 0)));
  run(1000 * kMs);
  tick.finish();
  EXPECT_EQ(device.written_N, Vec3::Zero());
}

TEST_F(TickTest, FlushesDenormalsInsideAloneAndLeavesTheCallerAsItWas) {
  volatile double small = std::numeric_limits<double>::min();
  static double inside;
  device.context = nullptr;
  device.onWrite = [](void*) {
    volatile double value = std::numeric_limits<double>::min();
    inside = value / 2;
  };
  run(kMs);
  EXPECT_EQ(inside, 0.0);
  EXPECT_GT(small / 2, 0.0);
}

// The tests of old forces render 2 N along y.
class OldForceTest : public TickTest {
 protected:
  OldForceTest() {
    tick.snapshots().publish(constantForce(1, Vec3(0, 2, 0)));
    run(1000 * kMs);
    EXPECT_NEAR(device.written_N.y(), 2, 1e-9);
  }
};

TEST_F(OldForceTest, ATickThatTakesLongerThanThreeMillisecondsWritesZeroAndForcesRampIn) {
  device.onRead = [&] { clock.advance(kOldestForce + 1); };
  const TickReport late = run(kMs);
  EXPECT_TRUE(device.written_N.isZero(0));
  EXPECT_TRUE(late.force_N.isZero(0));
  EXPECT_NE(late.guard.active & bit(Trip::late), 0U);
  EXPECT_EQ(late.guard.counts[static_cast<std::size_t>(Trip::late)], 1U);
  device.onRead = nullptr;
  EXPECT_LT(run(kMs).force_N.norm(), 0.01);
  EXPECT_NEAR(run(250 * kMs).force_N.y(), 1, 0.05);
  EXPECT_NEAR(run(300 * kMs).force_N.y(), 2, 1e-9);
}

TEST_F(OldForceTest, ATickThatTakesThreeMillisecondsIsInTime) {
  device.onRead = [&] { clock.advance(kOldestForce); };
  EXPECT_NEAR(run(kMs).force_N.y(), 2, 1e-9);
}

TEST_F(OldForceTest, AnOvertakenTickWritesZero) {
  device.onRead = [&] { EXPECT_TRUE(tick.overtake()); };
  EXPECT_TRUE(run(kMs).force_N.isZero(0));
  EXPECT_TRUE(device.written_N.isZero(0));
  EXPECT_EQ(device.zeroes, 1);
  device.onRead = nullptr;
  EXPECT_LT(run(kMs).force_N.norm(), 0.01) << "forces ramp in";
}

TEST_F(OldForceTest, ZeroFollowsAWriteThatWasOvertaken) {
  struct Late {
    FakeDevice* device;
    Tick* tick;
  } late{&device, &tick};
  device.context = &late;
  device.onWrite = [](void* context) {
    const Late& now = *static_cast<Late*>(context);
    if (now.device->zeroes > 0) return;
    // As if the force reached the motors after the watchdog's zero.
    const Vec3 old = now.device->written_N;
    now.tick->overtake();
    now.device->written_N = old;
  };
  const int before = device.writes;
  EXPECT_TRUE(run(kMs).force_N.isZero(0));
  EXPECT_EQ(device.writes, before + 2);
  EXPECT_TRUE(device.written_N.isZero(0));
}

TEST_F(OldForceTest, ATickMoreThanTwentyMillisecondsLateGivesNoForce) {
  EXPECT_TRUE(runLate(30 * kMs).force_N.isZero(0));
  EXPECT_EQ(tick.last().guard.latched, 0U);
  EXPECT_LT(run(2 * kMs).force_N.norm(), 0.02);
}

TEST_F(OldForceTest, ReportsThatAStopHasReachedTheMotors) {
  EXPECT_FALSE(tick.stoppedAtZero());
  tick.control().stop();
  EXPECT_FALSE(tick.stoppedAtZero());
  run(kMs);
  EXPECT_TRUE(tick.stoppedAtZero());
}

TEST_F(OldForceTest, AStopHasNotReachedTheMotorsWhileTheDriverHasItsZero) {
  device.sends = false;
  tick.control().stop();
  run(10 * kMs);
  EXPECT_FALSE(tick.stoppedAtZero());
  device.sends = true;
  run(kMs);
  EXPECT_TRUE(tick.stoppedAtZero());
}

// A device that ends forces by itself which are not renewed for 3 ms. Renders 2 N along y.
class ForceLifeTest : public testing::Test {
 protected:
  ForceLifeTest() {
    tick.snapshots().publish(constantForce(1, Vec3(0, 2, 0)));
    run(1000);
    EXPECT_NEAR(device.written_N.y(), 2, 1e-9);
  }
  static TickOptions options() {
    TickOptions options = armed();
    options.forceLife = kLife;
    return options;
  }
  void pass(Nanos time) {
    clock.advance(time);
    tick(clock.now());
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) pass(kMs);
  }

  static constexpr Nanos kLife = 3 * kMs;
  FakeDevice device;
  FakeClock clock;
  Tick tick{device, clock, options()};
};

TEST_F(ForceLifeTest, AfterAPauseThatEndedItTheForceStartsFromZero) {
  for (const Nanos pause : {kLife + 1, 4 * kMs, 8 * kMs, 19 * kMs, 40 * kMs}) {
    pass(pause);
    EXPECT_TRUE(device.written_N.isZero(0)) << pause;
    EXPECT_NE(tick.last().guard.active & bit(Trip::late), 0U);
    EXPECT_TRUE(tick.last().force_N.isZero(0));
    for (double before = 0; device.written_N.y() < 2 - 1e-9; before = device.written_N.y()) {
      run(1);
      ASSERT_LT(device.written_N.y(), before + 0.0041) << "it ramps over half a second";
    }
  }
}

TEST_F(ForceLifeTest, APauseThatItOutlivesChangesNothing) {
  pass(kLife);
  EXPECT_NEAR(device.written_N.y(), 2, 1e-9);
  EXPECT_EQ(tick.last().guard.counts[static_cast<std::size_t>(Trip::late)], 0U);
}

TEST_F(ForceLifeTest, AForceThatEndsDuringTheTickIsNotBroughtBackByIt) {
  device.onRead = [&] { clock.advance(2 * kMs); };
  pass(2 * kMs);
  EXPECT_TRUE(device.written_N.isZero(0));
  device.onRead = nullptr;
  run(2);
  EXPECT_LT(device.written_N.y(), 0.01);
}

TEST_F(ForceLifeTest, AForceThatEndsDuringTheWriteIsFollowedByZero) {
  device.context = &clock;
  device.onWrite = [](void* context) { static_cast<FakeClock*>(context)->advance(2 * kMs); };
  run(1);
  const int before = device.writes;
  pass(kMs);
  EXPECT_EQ(device.writes, before + 2) << "2 ms between the writes, and 2 ms for this one";
  EXPECT_TRUE(device.written_N.isZero(0));
}

TEST_F(ForceLifeTest, ADeviceWithoutSuchALifeKeepsItsForce) {
  Tick other{device, clock, armed()};
  other.snapshots().publish(constantForce(1, Vec3(0, 2, 0)));
  for (int i = 0; i < 1000; ++i) {
    clock.advance(kMs);
    other(clock.now());
  }
  clock.advance(8 * kMs);
  other(clock.now());
  EXPECT_NEAR(device.written_N.y(), 2, 1e-9) << "it decays from there";
}

// A sheet 1 mm above the origin, 1000 N/m from both sides.
class LostHandTest : public TickTest {
 protected:
  LostHandTest() {
    fixture::SceneFixture scene;
    scene.faces = scene::TouchableFaces::both;
    scene.add(fixture::heightField(0.5, 1, [](double, double) { return kSheet_m; }), fixture::surface(1000));
    tick.snapshots().publish(scene.snapshot());
  }
  void put(double height_m) { device.state.position_m = Vec3(0.01, 0.02, kSheet_m + height_m); }
  double rendered_N() const { return tick.last().rendering.force_N.z(); }
  // Upwards positive. The force of a hand that leaps is lowered to what the guard lets through.
  double held_m() const {
    const Rendering& rendering = tick.last().rendering;
    return std::copysign(rendering.depth_m, rendering.force_N.z());
  }
  void lose() {
    device.gives = false;
    run(kOutOfSight + kMs);
    device.gives = true;
  }

  static constexpr double kSheet_m = 0.001;
  int placements_ = 0;
};

TEST_F(LostHandTest, IsNotAtTheOriginBeforeItsFirstState) {
  device.gives = false;
  put(0.002);
  run(10 * kMs);
  device.gives = true;
  run(1000 * kMs);
  EXPECT_EQ(rendered_N(), 0) << "it never was at the origin, below the sheet";
  put(-0.001);
  run(1000 * kMs);
  EXPECT_NEAR(rendered_N(), 1, 1e-6) << "it came from above";
}

TEST_F(LostHandTest, StartsAnewWhereItIsFoundAgain) {
  put(0.002);
  run(10 * kMs);
  put(-0.001);
  run(1000 * kMs);
  ASSERT_NEAR(tick.last().force_N.z(), 1, 1e-6);
  device.gives = false;
  run(kOutOfSight + kMs);
  put(-0.1);
  device.gives = true;
  run(kMs);
  EXPECT_FALSE(tick.last().rendering.touching) << "nothing pulls it back through the sheet";
  run(1000 * kMs);
  EXPECT_EQ(rendered_N(), 0);
  put(0.001);
  run(kMs);
  EXPECT_NEAR(rendered_N(), -1, 1e-6) << "the sheet is between it and the way back";
}

TEST_F(LostHandTest, KeepsItsContactWhereItWasLost) {
  put(0.002);
  run(10 * kMs);
  put(-0.001);
  run(1000 * kMs);
  device.gives = false;
  run(1000 * kMs);
  put(0.001 - kElsewhere_m);
  device.gives = true;
  run(kMs);
  EXPECT_NEAR(held_m(), 0.004, 1e-6);
}

TEST_F(LostHandTest, AFaultOfTheDeviceLosesIt) {
  put(0.002);
  run(10 * kMs);
  put(-0.001);
  run(1000 * kMs);
  device.state.hold = device::kHoldFault;
  run(kOutOfSight + kMs);
  put(-0.1);
  device.state.hold = 0;
  run(kMs);
  EXPECT_FALSE(tick.last().rendering.touching);
}

TEST_F(LostHandTest, StartsAnewWhereACalibrationPutsIt) {
  device.state.hold = device::kHoldNotCalibrated;
  put(0.002);
  run(10 * kMs);
  device.state.hold = 0;
  put(-0.004);
  run(kMs);
  EXPECT_FALSE(tick.last().rendering.touching);
  device.state.hold = device::kHoldNotCalibrated;
  put(0.002);
  run(kMs);
  EXPECT_FALSE(tick.last().rendering.touching);
  put(-0.001);
  run(10 * kMs);
  EXPECT_NEAR(rendered_N(), 1, 1e-6) << "it moves though nobody knows where";
  device.state.hold = 0;
  put(-0.002);
  run(kMs);
  EXPECT_NEAR(rendered_N(), 2, 1e-6) << "one that changes little loses nothing";
}

TEST_F(LostHandTest, ALoopThatDidNotRunLosesIt) {
  put(0.002);
  run(10 * kMs);
  put(-0.001);
  run(1000 * kMs);
  put(-0.1);
  runLate(3000 * kMs);
  EXPECT_FALSE(tick.last().rendering.touching);
}

TEST_F(LostHandTest, NobodyIsToldThatItTouchesMovesOrPresses) {
  put(0.002);
  run(10 * kMs);
  put(-0.001);
  device.state.velocity_m_per_s = Vec3(0.1, 0, 0);
  device.state.buttons = 1;
  run(100 * kMs);
  ASSERT_TRUE(tick.last().rendering.touching);
  device.state.hold = device::kHoldFault;
  run(kOutOfSight);
  EXPECT_TRUE(tick.last().rendering.touching) << "a short silence is not told";
  run(kMs);
  EXPECT_FALSE(tick.last().rendering.touching);
  EXPECT_EQ(tick.last().rendering.proxy_m, device.state.position_m);
  EXPECT_TRUE(tick.last().device.velocity_m_per_s.isZero(0));
  EXPECT_EQ(tick.last().device.buttons, 0U);
  device.state.hold = 0;
  run(kMs);
  EXPECT_NEAR(rendered_N(), 1, 1e-6);
  EXPECT_EQ(tick.last().device.buttons, 1U);
}

TEST_F(LostHandTest, PlanesAboveItAreLeftOutUntilItLeavesThem) {
  for (const Nanos recovery : {Nanos{0}, 100 * kMs}) {
    fixture::SceneFixture scene;
    scene.planes.emplace_back();
    scene.planes[0].normal = Vec3::UnitZ();
    scene.planes[0].surface = fixture::surface(1000);
    scene.planes[0].recovery = recovery;
    scene.planes[0].placement = static_cast<std::uint32_t>(++placements_);
    tick.snapshots().publish(scene.snapshot());
    device.state.position_m = Vec3(0, 0, 0.01);
    run(1000 * kMs);
    device.state.position_m = Vec3(0, 0, -0.001);
    run(1000 * kMs);
    ASSERT_NEAR(tick.last().force_N.z(), 1, 1e-6);
    lose();
    device.state.position_m = Vec3(0, 0, -0.02);
    run(1000 * kMs);
    EXPECT_EQ(tick.last().force_N.norm(), 0);
    EXPECT_NE(tick.last().rendering.status & kRenderEnclosed, 0U);
    device.state.position_m = Vec3(0, 0, 0.001);
    run(kMs);
    EXPECT_EQ(tick.last().rendering.status, 0U);
    device.state.position_m = Vec3(0, 0, -0.001);
    run(1000 * kMs);
    EXPECT_NEAR(tick.last().force_N.z(), 1, 1e-6);
  }
}

TEST_F(LostHandTest, FrictionInTheAirDoesNotPullItBack) {
  fixture::SceneFixture scene;
  scene.effects.emplace_back();
  scene.effects[0].type = scene::EffectType::friction;
  scene.effects[0].gain = 1000;
  scene.effects[0].magnitude_N = 2;
  tick.snapshots().publish(scene.snapshot());
  device.state.position_m = Vec3::Zero();
  run(1000 * kMs);
  lose();
  device.state.position_m = Vec3(0, 0, -0.1);
  run(1000 * kMs);
  EXPECT_EQ(tick.last().force_N.norm(), 0);
  device.state.position_m = Vec3(0, 0, -0.099);
  run(kMs);
  EXPECT_NEAR(tick.last().force_N.z(), -1, 1e-6);
}

// A surface that a client streams sixty times a second.
TEST_F(LostHandTest, RemoteContactsStatedBeforeDoNotPullItBack) {
  tick.snapshots().publish(fixture::SceneFixture().snapshot());
  RemoteInput input;
  const auto state = [&](double height_m) {
    RemoteContact& contact = input.contacts.contacts[0];
    contact.id = 1;
    contact.point_m = Vec3(0, 0, height_m);
    contact.normal = Vec3::UnitZ();
    contact.stiffness_N_per_m = 800;
    input.contacts.count = 1;
    input.contacts.received = input.contacts.stated = now_;
    ++input.contacts.number;
    tick.remote().write(input);
    double most = 0;
    for (int i = 0; i < 16; ++i) most = std::max(most, run(kMs).force_N.norm());
    return most;
  };
  device.state.position_m = Vec3(0, 0, 0.005);
  state(0);
  device.state.position_m = Vec3(0, 0, -0.001);
  for (int i = 0; i < 60; ++i) state(0);
  ASSERT_NEAR(tick.last().force_N.z(), 0.8, 1e-3);
  device.gives = false;
  for (int i = 0; i < 4; ++i) state(0);
  device.gives = true;
  device.state.position_m = Vec3(0, 0, -0.1);
  for (int i = 0; i < 16; ++i) EXPECT_EQ(run(kMs).force_N.norm(), 0) << i;
  for (int i = 0; i < 60; ++i) EXPECT_EQ(state(-0.15), 0) << i;
}

TEST_F(LostHandTest, TheEnergyForHeldForcesIsToldBeforeTheFirstOneAndWhileItIsLost) {
  tick.snapshots().publish(fixture::SceneFixture().snapshot());
  put(0);
  run(10 * kMs);
  EXPECT_EQ(tick.last().remote.energy_J, 0.020) << "what a new tank has";
  RemoteInput input;
  input.force.number = 1;
  input.force.received = now_;
  input.force.lifetime = 10'000 * kMs;
  input.force.force_N = Vec3(0, 0, -1);
  tick.remote().write(input);
  for (int i = 0; i < 20; ++i) {
    device.state.position_m.z() += 0.5e-3;
    device.state.velocity_m_per_s = Vec3(0, 0, 0.5);
    run(kMs);
  }
  const double left_J = tick.last().remote.energy_J;
  EXPECT_GT(left_J, 0.0205) << "the hand put something in";
  lose();
  EXPECT_GE(tick.last().remote.energy_J, left_J);
}

TEST_F(LostHandTest, HeldForcesDoNotAddUpBeforeItsFirstState) {
  device.gives = false;
  RemoteInput input;
  input.force.number = 1;
  input.force.lifetime = 10'000 * kMs;
  input.force.force_N = Vec3(0, 0, 1);
  tick.remote().write(input);
  run(1000 * kMs);
  EXPECT_TRUE(tick.last().rendering.force_N.isZero(0));
  EXPECT_EQ(tick.last().guard.counts[static_cast<std::size_t>(Trip::peakForce)], 0U);
  device.gives = true;
  device.state.position_m = Vec3(0, 0, 0.1);
  run(20 * kMs);
  EXPECT_EQ(tick.last().remote.status, 0U) << "the way to where it is did not use its energy";
}

// The guard lets a third of 10 N through. A client that resists with them, and pushes along with what the
// guard takes, would get the rest as a gift.
TEST_F(LostHandTest, HeldForcesGiveNoMoreThanTheHandPutIn) {
  tick.snapshots().publish(fixture::SceneFixture().snapshot());
  put(0);
  run(10 * kMs);
  RemoteInput input;
  input.force.lifetime = 10'000 * kMs;
  double given_J = 0;
  const auto move = [&](double way_m, double force_N) {
    ++input.force.number;
    input.force.received = now_;
    input.force.force_N = Vec3(0, 0, force_N);
    tick.remote().write(input);
    const double step_m = std::copysign(0.05e-3, way_m);
    for (int i = 0; i < std::lround(way_m / step_m); ++i) {
      given_J += device.written_N.z() * step_m;
      device.state.position_m.z() += step_m;
      device.state.velocity_m_per_s = Vec3(0, 0, step_m / 1e-3);
      run(kMs);
    }
  };
  for (int round = 0; round < 50; ++round) {
    move(0.005, -10);
    move(-0.015, -3.3);
    move(0.010, 0);
  }
  EXPECT_LT(given_J, 0.020 + 30 * 0.020 + 0.02) << "the start, the refill of 30 s, and rounding";
  EXPECT_GT(given_J, 0.05) << "and that it gives";
}

TEST_F(LostHandTest, AShortSilenceDoesNotLoseIt) {
  put(0.002);
  run(10 * kMs);
  put(-0.001);
  run(1000 * kMs);
  device.gives = false;
  run(kOutOfSight - kMs);
  put(-0.003);
  device.gives = true;
  run(kMs);
  EXPECT_NEAR(held_m(), 0.003, 1e-6);
  device.state.hold = device::kHoldDeadMan;
  run(1000 * kMs);
  device.state.hold = 0;
  run(kMs);
  EXPECT_NEAR(held_m(), 0.003, 1e-6) << "a switch does not hide the hand";
}

class WatchdogTest : public OldForceTest {
 protected:
  base::FakeWorld world;
  static inline Nanos suspended = 0;
  Watchdog watchdog{tick, clock, []() noexcept { return suspended; }};
};

TEST_F(WatchdogTest, EndsTheForceAfterTwentyMillisecondsOfSilence) {
  watchdog.start();
  run(kMs);
  for (Nanos t = 0; t <= 20 * kMs; t += kMs) {
    clock.advance(kMs);
    run(kMs);
    world.threads.runUntil(world.clock.now() + kMs);
  }
  EXPECT_EQ(device.zeroes, 0) << "ticks end";
  clock.advance(Watchdog::kSilence);
  world.threads.runUntil(world.clock.now() + Watchdog::kStep);
  EXPECT_EQ(device.zeroes, 0);
  clock.advance(1);
  world.threads.runUntil(world.clock.now() + Watchdog::kStep);
  EXPECT_EQ(device.zeroes, 1);
  EXPECT_TRUE(watchdog.overtook());
  EXPECT_TRUE(watchdog.canZero());
  EXPECT_GT(watchdog.silence(), Watchdog::kSilence);
  world.threads.runUntil(world.clock.now() + 2 * Watchdog::kStep);
  EXPECT_EQ(device.zeroes, 3) << "again in every step";
  run(kMs);
  world.threads.runUntil(world.clock.now() + Watchdog::kStep);
  EXPECT_FALSE(watchdog.overtook());
  watchdog.stop();
  EXPECT_EQ(watchdog.silence(), 0);
  clock.advance(1000 * kMs);
  EXPECT_EQ(world.threads.nextDeadline(), std::nullopt);
}

TEST_F(WatchdogTest, StopsTheForcesAfterASuspensionOfTheMachine) {
  watchdog.start();
  world.threads.runUntil(world.clock.now() + Watchdog::kStep);
  EXPECT_FALSE(tick.control().stopped());
  EXPECT_FALSE(watchdog.takeResumed());
  suspended += 60'000 * kMs;
  world.threads.runUntil(world.clock.now() + Watchdog::kStep);
  EXPECT_TRUE(tick.control().stopped());
  EXPECT_TRUE(watchdog.takeResumed());
  EXPECT_FALSE(watchdog.takeResumed());
}

}  // namespace
}  // namespace hapticd::realtime

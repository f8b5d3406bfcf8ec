// One tick with a scripted device: its calls, their order, and its report.
#include "realtime/servo/tick.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "realtime/servo/fakes.h"
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

}  // namespace
}  // namespace hapticd::realtime

// The server's tick in the vendor's scheduler.
#include "base/clock.h"
#include "device/openhaptics/hd_fixture.h"
#include "device/plane_scene.h"

namespace hapticd::device {
namespace {

TEST_F(SteppedHdTest, APlaneFeelsAsOnTheSimulatedDevice) {
  const std::vector<Vec3> places = plane_scene::places();
  const std::vector<Vec3> expected = plane_scene::referenceForces(places);
  device.open();
  base::SimulatedClock
      clock;  // stands: a pause of the machine within a tick does not make its force too old to be written
  realtime::Tick tick(device, clock, plane_scene::raw());
  tick.snapshots().publish(plane_scene::snapshot());
  device.start([&](Nanos now) { tick(now); });
  double most = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    hand(places[i]);
    step();
    EXPECT_LE((force() - expected[i]).norm(), 0.01 * expected[i].norm() + 1e-9) << "tick " << i;
    most = std::max(most, force().norm());
  }
  EXPECT_NEAR(most, 1.5, 0.05) << "3 mm at 500 N/m";
}

TEST_F(HdTest, TheGuardOfTheTickHoldsUntilArmedAndLatchesADisconnectInContact) {
  OpenHapticsDevice device;
  device.open();
  base::MonotonicClock clock;
  realtime::TickOptions options;
  options.guard = realtime::GuardOptions::of(device.profile());
  options.guard.late = 1'000'000'000;  // a loaded machine is not what is tested here
  options.guard.stalled = 2'000'000'000;
  realtime::Tick tick(device, clock, options);
  tick.snapshots().publish(plane_scene::snapshot());
  hand(Vec3(0, 0, 0.005));
  device.start([&](Nanos now) { tick(now); });
  const auto ticks = [&](int more) {
    const int from = mock->frames(0);
    return eventually([&] { return mock->frames(0) >= from + more; });
  };
  EXPECT_TRUE(ticks(5));
  hand(Vec3(0, 0, -0.003));
  EXPECT_TRUE(ticks(5));
  EXPECT_TRUE(force().isZero()) << "real devices start disarmed";
  tick.control().arm();
  EXPECT_TRUE(eventually([&] { return force().norm() > 1.4; })) << force().transpose();

  mock->unplug(0);
  EXPECT_TRUE(ticks(3));
  EXPECT_TRUE(force().isZero());
  device.stop();
  EXPECT_NE(tick.last().guard.latched & bit(realtime::Trip::deviceFault), 0U);
}

}  // namespace
}  // namespace hapticd::device

// Touch and its relatives on a mock of libHD that aborts where the vendor's library would crash.
#include <unistd.h>

#include <atomic>
#include <stdexcept>
#include <string>

#include "device/openhaptics/hd_fixture.h"
#include "device/plane_scene.h"

namespace hapticd::device {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

std::string refusal(Device& device) {
  try {
    device.open();
    return "opened";
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

TEST_F(HdTest, HandleZeroIsADeviceAndTheDriversNumbersWin) {
  OpenHapticsDevice device;
  device.open();
  EXPECT_EQ(mock->isOpen(0), 1);
  EXPECT_THAT(device.description(), AllOf(HasSubstr("Touch"), HasSubstr("MOCK-0001")));
  const DeviceProfile& profile = device.profile();
  EXPECT_DOUBLE_EQ(profile.peakForce_N, 3.3);
  EXPECT_DOUBLE_EQ(profile.continuousForce_N, 0.88);
  EXPECT_DOUBLE_EQ(profile.nominalStiffness_N_per_m, 500);
  EXPECT_TRUE(profile.workspace_m.max.isApprox(Vec3(0.080, 0.060, 0.035)));
  EXPECT_FALSE(profile.startsArmed);
  EXPECT_TRUE(device.traits().selfPaced);
  EXPECT_EQ(mock->schedulerRuns(), 0) << "amplifiers on before start()";
  device.close();
  device.close();
  EXPECT_EQ(mock->isOpen(0), 0);
}

TEST_F(HdTest, TriesTheNamesInOrder) {
  const char* const answering[] = {nullptr, "Default Device", "Default PHANToM"};
  for (const char* name : answering) {
    mock->reset();
    mock->onlyName(name);
    OpenHapticsDevice device;
    EXPECT_EQ(refusal(device), "opened");
    EXPECT_THAT(device.description(), HasSubstr(name == nullptr ? "the default device" : name));
  }
}

// The default device may be another arm, at which nobody sits.
TEST_F(HdTest, AConfiguredNameIsTheOnlyOneTried) {
  for (const char* name : {static_cast<const char*>(nullptr), "Default Device", "Default PHANToM"}) {
    mock->reset();
    mock->onlyName(name);
    OpenHapticsDevice device({"mine"});
    EXPECT_THAT(refusal(device), HasSubstr("'mine'"));
  }
  mock->reset();
  mock->onlyName("mine");
  OpenHapticsDevice device({"mine"});
  EXPECT_EQ(refusal(device), "opened");
}

TEST_F(HdTest, TellsEveryErrorAlsoWhenTheLibraryRepeatsNone) {
  mock->onlyName("somebody else's");
  OpenHapticsDevice device;
  const std::string first = refusal(device);
  EXPECT_THAT(first, AllOf(HasSubstr("the default device: HD_DEVICE_FAULT"),
                           HasSubstr("'Default PHANToM': fails as before")));
  EXPECT_THAT(refusal(device), HasSubstr("the default device: fails as before"));
}

TEST_F(HdTest, AWrongLibraryIsToldByItsMissingFunctions) {
  // In a process of its own: the library is loaded once.
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        setenv("HAPTICD_HDAPI_LIB", "/nowhere/libHD.so", 1);
        OpenHapticsDevice device;
        fprintf(stderr, "%s", refusal(device).c_str());
        exit(0);
      },
      testing::ExitedWithCode(0), "/nowhere/libHD.so");
}

TEST_F(HdTest, TheBannerCannotTakeAKey) {
  int keys[2];
  ASSERT_EQ(pipe(keys), 0);
  ASSERT_EQ(write(keys[1], "x", 1), 1);
  const int stdinBefore = dup(STDIN_FILENO);
  dup2(keys[0], STDIN_FILENO);
  mock->banner(1);
  OpenHapticsDevice device;
  EXPECT_EQ(refusal(device), "opened");
  device.close();
  char key = 0;
  EXPECT_EQ(read(STDIN_FILENO, &key, 1), 1) << "stdin is back";
  EXPECT_EQ(key, 'x');
  dup2(stdinBefore, STDIN_FILENO);
  for (const int fd : {keys[0], keys[1], stdinBefore}) close(fd);
}

TEST_F(HdTest, TheMockAbortsWhereTheVendorsLibraryCrashes) {
  using Get = void (*)(unsigned, double*);
  const auto get = reinterpret_cast<Get>(dlsym(dlopen(MOCK_HD, RTLD_NOW), "hdGetDoublev"));
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  double v[6];
  EXPECT_DEATH(get(0x2603, v), "without a device");
}

TEST_F(SteppedHdTest, StateIsInSiAndInTheDeviceFrame) {
  start();
  EXPECT_EQ(mock->priority(), 65535);
  hand(Vec3(0.01, -0.02, 0.03), Vec3(0.1, 0.2, -0.3));
  mock->buttons(0, 2);
  const double quarterAboutZ[9] = {0, 1, 0, -1, 0, 0, 0, 0, 1};  // columns
  mock->turn(0, quarterAboutZ);
  mock->temperature(0, 0.25);
  step();
  ASSERT_TRUE(stateRead);
  EXPECT_TRUE(state.position_m.isApprox(Vec3(0.01, -0.02, 0.03)));
  EXPECT_TRUE(state.velocity_m_per_s.isApprox(Vec3(0.1, 0.2, -0.3)));
  EXPECT_TRUE(state.angularVelocity_rad_per_s.isApprox(Vec3(0.1, 0.2, 0.3)));
  EXPECT_TRUE((state.orientation * Vec3::UnitX()).isApprox(Vec3::UnitY()));
  EXPECT_EQ(state.buttons, 2U);
  EXPECT_EQ(state.hold, kHoldNone);
  EXPECT_DOUBLE_EQ(state.motorTemperature, 0.25);
  EXPECT_GT(state.time, 0);
  DeviceState outside;
  EXPECT_FALSE(device.read(0, outside)) << "no state outside of a tick";
  EXPECT_FALSE(device.write(Vec3::UnitX())) << "no force outside of a tick";
}

TEST_F(SteppedHdTest, ForceArrivesInTheSameFrameAndWithinTheLimits) {
  start();
  wanted_N = Vec3(0, 1, -0.5);
  step();
  EXPECT_TRUE(force().isApprox(wanted_N));
  wanted_N = Vec3(0, 0, 9);
  step(3);
  EXPECT_TRUE(force().isApprox(Vec3(0, 0, 3.3))) << force().transpose();
  wanted_N = Vec3::Zero();
  step();
  EXPECT_TRUE(force().isZero());
  EXPECT_EQ(state.hold, kHoldNone) << device.faultText();
}

TEST_F(SteppedHdTest, NoForceAboveTheDriversOwnSpeedLimit) {
  start();
  wanted_N = Vec3(1, 0, 0);
  step();
  hand(Vec3::Zero(), Vec3(1.3, 0, 0));
  step();
  EXPECT_TRUE(force().isZero());
  EXPECT_EQ(state.hold, kHoldNone) << "the driver was not provoked";
  EXPECT_FALSE(taken) << "the guard learns of it";
  wanted_N = Vec3::Zero();
  step();
  EXPECT_FALSE(taken) << "one refusal until the arm is slow";
  hand(Vec3::Zero(), Vec3(0.1, 0, 0));
  step();
  EXPECT_TRUE(taken);
  hand(Vec3::Zero(), Vec3(1.3, 0, 0));
  step();
  EXPECT_TRUE(taken) << "nothing is withheld from a hand that is free";
}

// Quick taps within a contact: the motors get zero, and no step when the arm is slow again.
TEST_F(SteppedHdTest, AForceThatWasWithheldFromAQuickArmRampsIn) {
  device.open();
  base::SimulatedClock clock;
  realtime::TickOptions options;
  options.guard = realtime::GuardOptions::of(device.profile());
  options.guard.armed = true;
  options.guard.late = options.guard.lateDecay = options.guard.stalled = 1'000'000'000'000;
  realtime::Tick tick(device, clock, options);
  tick.snapshots().publish(plane_scene::snapshot());
  Nanos now = 0;
  device.start([&](Nanos) { tick(now += 1'000'000); });
  hand(Vec3(0, 0, 0.002));
  step();
  hand(Vec3(0, 0, -0.003));
  step(1000);
  ASSERT_NEAR(force().norm(), 1.5, 0.1);
  hand(Vec3(0, 0, -0.003), Vec3(1.3, 0, 0));
  step(2);
  ASSERT_TRUE(force().isZero());
  hand(Vec3(0, 0, -0.003));
  for (double before = 0; force().norm() < 1.4; before = force().norm()) {
    step();
    ASSERT_LT(force().norm(), before + 0.01);
  }
}

TEST_F(SteppedHdTest, AZeroHasLeftWithItsFrame) {
  device.open();
  bool sent = false;
  device.start([&](Nanos) {
    device.write(wanted_N);
    sent = device.zeroSent();
  });
  step(2);
  EXPECT_TRUE(sent);
  wanted_N = Vec3(0, 1, 0);
  step();
  EXPECT_FALSE(sent);
  wanted_N = Vec3::Zero();
  step();
  EXPECT_FALSE(sent) << "in the tick, the motors still have the force of the last frame";
  step();
  EXPECT_TRUE(sent);
}

TEST_F(SteppedHdTest, ForceThatIsNotANumberIsRefused) {
  start();
  wanted_N = Vec3(0, std::nan(""), 0);
  step();
  EXPECT_TRUE(force().isZero());
}

// Nothing renders a torque: what another program left there goes with the first frame.
TEST_F(SteppedHdTest, AGimbalWithMotorsGetsZeroTorque) {
  mock->model("Premium 1.5/6DOF", 1);
  mock->outputDof(6);
  start();
  EXPECT_EQ(device.profile().outputDof, 6);
  EXPECT_EQ(device.profile().switches, 0U);
  Vec3 torque;
  mock->torque(0, torque.data());
  ASSERT_FALSE(torque.isZero());
  wanted_N = Vec3(0, 1, 0);
  step();
  mock->torque(0, torque.data());
  EXPECT_EQ(torque, Vec3(0, 0, 0));
  EXPECT_TRUE(force().isApprox(wanted_N));
}

TEST_F(SteppedHdTest, AGimbalWithoutMotorsGetsNoTorqueAtAll) {
  start();  // the mock would abort
  EXPECT_EQ(device.profile().inputDof, 6);
  EXPECT_EQ(device.profile().outputDof, 3);
  EXPECT_EQ(device.profile().switches, kHoldInkwell);
  step();
  Vec3 torque;
  mock->torque(0, torque.data());
  EXPECT_EQ(torque, Vec3(10, 10, 10));
}

TEST_F(SteppedHdTest, ADockedStylusHoldsTheForceAtOnce) {
  start();
  wanted_N = Vec3(0, 1, 0);
  step();
  mock->inkwellSwitch(0, 0);
  step();
  EXPECT_EQ(state.hold, kHoldInkwell);
  EXPECT_TRUE(force().isZero());
  mock->inkwellSwitch(0, 1);
  step();
  EXPECT_EQ(state.hold, kHoldNone);
  EXPECT_TRUE(force().isApprox(wanted_N));
}

TEST_F(SteppedHdTest, OnlyTheDesktopHasADeadManSwitch) {
  mock->safetySwitch(0, 0);
  start();
  step();
  EXPECT_EQ(state.hold, kHoldNone);
  device.close();
  mock->reset();
  mock->stepped(1);
  mock->model("Phantom Desktop", 2);
  mock->safetySwitch(0, 0);
  start();
  wanted_N = Vec3(0, 1, 0);
  step();
  EXPECT_EQ(state.hold, kHoldDeadMan);
  EXPECT_TRUE(force().isZero());
}

TEST_F(SteppedHdTest, WarmMotorsGetLessAndHotOnesNothing) {
  start();
  wanted_N = Vec3(0, 0, 3.3);
  mock->temperature(0, 0.8);
  step(100);
  const double after100 = force().norm();
  EXPECT_NEAR(after100, 3.3 * std::pow(0.999, 100), 1e-6);
  step(3000);
  EXPECT_NEAR(force().norm(), 0.88, 1e-9) << "what it can hold for ever";
  mock->temperature(0, 0.96);
  step();
  EXPECT_EQ(state.hold, kHoldHot);
  EXPECT_TRUE(force().isZero());
  mock->temperature(0, 0.8);
  step();
  EXPECT_EQ(state.hold, kHoldHot) << "no chatter at the limit";
  mock->temperature(0, 0.4);
  step(2000);
  EXPECT_EQ(state.hold, kHoldNone);
  EXPECT_NEAR(force().norm(), 3.3, 1e-9);
}

TEST_F(SteppedHdTest, AForceErrorThatIsOverIsStillReportedOnce) {
  start();
  wanted_N = Vec3(0, 1, 0);
  step();
  mock->fail(0, 0x201);
  step(2);
  EXPECT_EQ(state.hold, kHoldFault);
  EXPECT_TRUE(eventually([&] {
    step();
    return state.hold == kHoldNone;
  }));
  EXPECT_THAT(device.faultText(), HasSubstr("HD_EXCEEDED_MAX_FORCE"));
  EXPECT_THAT(device.faultText(), IsEmpty());
}

TEST_F(SteppedHdTest, AForceErrorHoldsForAMomentAndADeviceFaultUntilReopened) {
  start();
  wanted_N = Vec3(0, 1, 0);
  step();
  mock->fail(0, 0x201);
  step(2);
  EXPECT_EQ(state.hold, kHoldFault);
  EXPECT_TRUE(force().isZero());
  EXPECT_THAT(device.faultText(), HasSubstr("HD_EXCEEDED_MAX_FORCE"));
  EXPECT_TRUE(eventually([&] {
    step();
    return state.hold == kHoldNone;
  }));
  EXPECT_TRUE(force().isApprox(wanted_N));
  EXPECT_THAT(device.faultText(), IsEmpty());

  mock->unplug(0);
  step(2);
  EXPECT_EQ(state.hold, kHoldFault);
  EXPECT_TRUE(force().isZero());
  EXPECT_THAT(device.faultText(), AllOf(HasSubstr("HD_COMM_ERROR"), HasSubstr("anew")));
  std::this_thread::sleep_for(std::chrono::milliseconds(150));
  step(100);
  EXPECT_EQ(state.hold, kHoldFault) << "the library tells the same error only once";

  device.close();
  mock->reset();
  mock->stepped(1);
  start();
  step();
  EXPECT_EQ(state.hold, kHoldNone);
  EXPECT_TRUE(force().isApprox(wanted_N));
}

// The library is silent about an error that it has told before.
TEST_F(SteppedHdTest, ACableThatIsPulledAgainIsNoticedByAnArmThatStandsStill) {
  start();
  wanted_N = Vec3(0, 1, 0);
  step(2000);
  EXPECT_EQ(state.hold, kHoldNone) << "a hand that rests moves a little";
  mock->unplug(0);
  step(2);
  EXPECT_EQ(state.hold, kHoldFault);
  device.close();
  mock->plugIn(0);
  start();
  step(2000);
  EXPECT_EQ(state.hold, kHoldNone);

  mock->unplug(0);
  step(400);
  EXPECT_EQ(state.hold, kHoldNone) << "nothing has told it yet";
  step(102);
  EXPECT_EQ(state.hold, kHoldFault);
  EXPECT_TRUE(force().isZero());
  EXPECT_TRUE(device.lost());
  EXPECT_THAT(device.faultText(), AllOf(HasSubstr("only once"), HasSubstr("cable")));
  device.close();
  mock->plugIn(0);
  start();
  step(2);
  EXPECT_EQ(state.hold, kHoldNone);
  EXPECT_EQ(device.faultText(), "");
}

TEST_F(SteppedHdTest, AnArmWithoutForceMayStandStillForEver) {
  start();
  mock->unplug(0);
  step(2);
  device.close();  // from here on an error has been told
  mock->plugIn(0);
  start();
  mock->unplug(0);
  step(5000);
  EXPECT_EQ(state.hold, kHoldNone);
}

TEST_F(SteppedHdTest, WarmMotorsErrorIsHeat) {
  start();
  mock->fail(0, 0x200);
  step(2);
  EXPECT_EQ(state.hold, kHoldHot);
}

TEST_F(SteppedHdTest, AutomaticCalibrationHappensUnderZeroForce) {
  mock->model("Touch X", 2);
  start();
  wanted_N = Vec3(0, 1, 0);
  step(150);
  ASSERT_TRUE(force().isApprox(wanted_N));
  mock->calibration(0, 0x5001);
  step(101);  // it is looked at every 100 frames
  EXPECT_EQ(mock->calibrationUpdates(0), 1);
  EXPECT_EQ(state.hold, kHoldNotCalibrated);
  EXPECT_TRUE(force().isZero());
  step(101);
  EXPECT_EQ(state.hold, kHoldNone);
  EXPECT_TRUE(force().isApprox(wanted_N));
}

TEST_F(HdTest, AnInkwellCalibrationWaitsForTheStylusAndForNothingElse) {
  mock->calibration(0, 0x5002);
  std::atomic<std::uint32_t> hold{0};
  std::atomic<int> ticks{0};
  OpenHapticsDevice device;
  EXPECT_THROW(device.calibrate(), std::runtime_error);
  device.open();
  device.start([&](Nanos now) {
    DeviceState state;
    device.read(now, state);
    device.write(Vec3(0, 1, 0));
    hold = state.hold;
    ++ticks;
  });
  ASSERT_TRUE(eventually([&] { return ticks > 5; }));
  EXPECT_EQ(hold, kHoldNotCalibrated);
  EXPECT_TRUE(force().isZero());
  EXPECT_THAT(device.faultText(), HasSubstr("inkwell"));
  mock->calibration(0, 0x5001);
  const int before = ticks;
  ASSERT_TRUE(eventually([&] { return ticks > before + 5; }));
  EXPECT_EQ(mock->calibrationUpdates(0), 0) << "the switch does not tell of a stylus";
  mock->inkwellSwitch(0, 0);
  EXPECT_TRUE(eventually([&] { return mock->calibrationUpdates(0) == 1; }));
  device.calibrate();  // nothing is left to do
  EXPECT_EQ(mock->calibrationUpdates(0), 1);
  EXPECT_TRUE(eventually([&] { return hold == kHoldInkwell; }));
  EXPECT_TRUE(force().isZero());
  mock->inkwellSwitch(0, 1);
  EXPECT_TRUE(eventually([&] { return force().isApprox(Vec3(0, 1, 0)); }));
}

TEST_F(SteppedHdTest, EncodersAreNotResetWithoutConsent) {
  mock->model("Premium 1.5", 1);
  mock->calibration(0, 0x5002);
  start();
  wanted_N = Vec3(0, 1, 0);
  step(300);
  EXPECT_EQ(mock->calibrationUpdates(0), 0);
  EXPECT_EQ(state.hold, kHoldNotCalibrated);
  EXPECT_TRUE(force().isZero());
  EXPECT_THAT(device.faultText(), AllOf(HasSubstr("reset position"), HasSubstr("--calibrate")));
}

TEST_F(SteppedHdTest, AStoppedCalibrationTakesItsConsentBack) {
  mock->model("Premium 1.5", 1);
  mock->calibration(0, 0x5002);
  start();
  int asked = 0;
  try {
    device.calibrate([&] { return ++asked == 2; });
    ADD_FAILURE();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "the calibration was stopped");
  }
  step(300);
  EXPECT_EQ(mock->calibrationUpdates(0), 0);
  EXPECT_EQ(state.hold, kHoldNotCalibrated);
}

TEST_F(HdTest, EncodersAreResetWithConsentGivenBefore) {
  mock->model("Premium 1.5", 1);
  mock->calibration(0, 0x5002);
  OpenHapticsOptions options;
  options.calibrate = true;
  OpenHapticsDevice device(options);
  device.open();
  device.start([&](Nanos) { device.write(Vec3(0, 0, 1)); });
  EXPECT_TRUE(eventually([&] { return force().isApprox(Vec3(0, 0, 1)); }));
  EXPECT_EQ(mock->calibrationUpdates(0), 1);
}

TEST_F(HdTest, NothingIsLeftBehind) {
  {
    OpenHapticsDevice device;
    device.open();
    device.start([&](Nanos) { device.write(Vec3(0, 2, 0)); });
    ASSERT_TRUE(eventually([&] { return force().norm() > 1.9; }));
    device.stop();
    EXPECT_TRUE(force().isZero());
    EXPECT_EQ(mock->schedulerRuns(), 0);
    device.start([&](Nanos) { device.write(Vec3(0, 2, 0)); });
    ASSERT_TRUE(eventually([&] { return force().norm() > 1.9; })) << "start after stop";
  }
  EXPECT_TRUE(force().isZero());
  EXPECT_EQ(mock->isOpen(0), 0);
}

TEST_F(HdTest, TwoDevicesShareOneScheduler) {
  OpenHapticsDevice first;
  OpenHapticsDevice second({"second"});
  first.open();
  first.start([&](Nanos) { first.write(Vec3(1, 0, 0)); });
  ASSERT_TRUE(eventually([&] { return force(0).norm() > 0.9; }));
  second.open();
  second.start([&](Nanos) { second.write(Vec3(0, 0, 1)); });
  ASSERT_TRUE(eventually([&] { return force(1).norm() > 0.9 && force(0).norm() > 0.9; }));
  mock->fail(1, 0x302);
  EXPECT_TRUE(eventually([&] { return force(1).isZero(); }));
  EXPECT_TRUE(force(0).isApprox(Vec3(1, 0, 0))) << "an error belongs to one device";
  second.close();
  EXPECT_TRUE(eventually([&] { return force(0).norm() > 0.9; })) << "the other goes on";
  const int frames = mock->frames(0);
  EXPECT_TRUE(eventually([&] { return mock->frames(0) > frames + 10; }));

  OpenHapticsDevice again;
  EXPECT_THAT(refusal(again), HasSubstr("open already"));
}

TEST_F(HdTest, RefusesARateThatTheDeviceDoesNotHave) {
  OpenHapticsOptions options;
  options.rate_Hz = 4000;
  OpenHapticsDevice device(options);
  device.open();
  EXPECT_THROW(device.start([](Nanos) {}), std::runtime_error);
  device.close();
}

}  // namespace
}  // namespace hapticd::device

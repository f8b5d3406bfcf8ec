#include "server/reports/reporter.h"
#include "base/time.h"
#include "server/reports/fresh_ticks.h"

#include <gtest/gtest.h>

namespace hapticd::server {
namespace {

using base::Nanos;
using geometry::Affine;
using geometry::Vec3;

constexpr Nanos kMs = 1'000'000;

class ReporterTest : public ::testing::Test {
 protected:
  ReporterTest() {
    config_.linearTolerance_m = 0.001;
    config_.angularTolerance_rad = 0.02;
    choice_.kinds |=
        wire::kReportHip | wire::kReportContactPoint | wire::kReportTouchButton | wire::kReportContactAnalog;
    tick_.T_world_device = Affine(Eigen::UniformScaling<double>(1000.0));
  }
  void start() {
    choice_.rate_Hz = config_.reportRate_Hz;
    reporter_ = std::make_unique<Reporter>(config_, 2, choice_);
  }
  // Advances by one tick.
  void step(Nanos by = kMs) {
    if (!reporter_) start();
    ++tick_.tick;
    tick_.time += by;
    out_.clear();
    frame_.buttons = tick_.device.buttons;
    reporter_->update(tick_, frame_, out_);
  }
  // The same for a tick behind which a newer one waits.
  void skip() {
    ++tick_.tick;
    tick_.time += kMs;
    out_.clear();
    frame_.buttons = tick_.device.buttons;
    reporter_->skip(tick_, frame_, out_);
  }
  template <class M>
  std::vector<M> reported() const {
    std::vector<M> found;
    for (const Outgoing& out : out_) {
      if (const M* m = out.message.as<M>()) found.push_back(*m);
    }
    return found;
  }
  template <class M>
  bool isReliable() const {
    for (const Outgoing& out : out_) {
      if (out.message.as<M>() != nullptr) return out.reliable;
    }
    return false;
  }
  void touch(double depth_m = 0.002) {
    realtime::Rendering& rendering = tick_.rendering;
    rendering.touching = true;
    rendering.touchedObject = 3;
    rendering.depth_m = depth_m;
    rendering.normal = Vec3::UnitZ();
    rendering.normalForce_N = Vec3(0, 0, 500 * depth_m);
    tick_.force_N = rendering.normalForce_N + Vec3(0.1, 0, 0);
    rendering.scp_m = rendering.proxy_m;
    rendering.contactCount = 1;
    rendering.contacts[0] = {.object = 3,
                             .triangle = 0,
                             .point_m = rendering.proxy_m,
                             .normal = Vec3::UnitZ(),
                             .force_N = rendering.normalForce_N};
  }

  DeviceConfig config_;
  ReportChoice choice_;
  ReportFrame frame_;
  realtime::TickReport tick_;
  std::unique_ptr<Reporter> reporter_;
  std::vector<Outgoing> out_;
};

TEST_F(ReporterTest, InFreeSpaceAtRestOnlyIsTouchingIsReportedEveryPeriod) {
  step();
  EXPECT_EQ(reported<wire::TrackerPosQuat>().size(), 2U);  // proxy and device, once
  for (int i = 0; i < 5; ++i) {
    step();
    ASSERT_EQ(out_.size(), 1U);
    EXPECT_EQ(reported<wire::IsTouching>().at(0).touching, 0);
  }
}

TEST_F(ReporterTest, LengthsAreWorldOverThousandAndForcesAreNewtons) {
  tick_.T_world_device = Eigen::Translation3d(500, 0, 0) * Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()) *
                         Eigen::UniformScaling<double>(2000.0);
  tick_.rendering.proxy_m = Vec3(0.01, 0, 0);
  tick_.device.position_m = Vec3(0.02, 0, 0);
  touch(0.002);
  step();
  const auto poses = reported<wire::TrackerPosQuat>();
  ASSERT_EQ(poses.size(), 3U);
  EXPECT_NEAR(poses[0].position[0], 0.5, 1e-12);   // (500 + 0) / 1000
  EXPECT_NEAR(poses[0].position[1], 0.02, 1e-12);  // 0.01 m * 2000 / 1000, rotated to +y
  EXPECT_NEAR(poses[1].position[1], 0.04, 1e-12);
  EXPECT_NEAR(reported<wire::Dop>().at(0).depth, 0.004, 1e-12);
  const auto force = reported<wire::Force>().at(0).force;
  EXPECT_NEAR(force[1], 0.1, 1e-12);
  EXPECT_NEAR(force[2], 1.0, 1e-12);
}

TEST_F(ReporterTest, OrientationAndAngularVelocityAreInTheWorldFrame) {
  tick_.T_world_device = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()) * Eigen::UniformScaling<double>(2000.0);
  tick_.device.orientation = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitX());
  tick_.device.velocity_m_per_s = Vec3(0.1, 0, 0);
  tick_.device.angularVelocity_rad_per_s = Vec3(M_PI, 0, 0);
  step();
  // First about the stylus's x, then with the device about z: (1 + k)(1 + i) / 2 = (1 + i + j + k) / 2.
  const auto pose = reported<wire::TrackerPosQuat>().at(0);
  for (const double q : pose.orientation) EXPECT_NEAR(q, 0.5, 1e-12);
  const auto velocity = reported<wire::TrackerVelocity>().at(0);
  EXPECT_NEAR(velocity.velocity[1], 0.2, 1e-12);
  const double half = 0.5 * M_PI * velocity.interval;
  EXPECT_NEAR(velocity.rotation[0], 0, 1e-12);
  EXPECT_NEAR(velocity.rotation[1], std::sin(half), 1e-12);
  EXPECT_NEAR(velocity.rotation[3], std::cos(half), 1e-12);
}

TEST_F(ReporterTest, PoseIsReportedWhenItChangedByMoreThanTheTolerance) {
  step();
  tick_.rendering.proxy_m = tick_.device.position_m = Vec3(0.0009, 0, 0);
  step();
  EXPECT_TRUE(reported<wire::TrackerPosQuat>().empty());
  tick_.rendering.proxy_m = Vec3(0.0011, 0, 0);
  step();
  ASSERT_EQ(reported<wire::TrackerPosQuat>().size(), 1U);
  EXPECT_EQ(reported<wire::TrackerPosQuat>()[0].sensor, kSensorProxy);
  tick_.device.orientation = Eigen::AngleAxisd(0.019, Vec3::UnitX());
  step();
  EXPECT_TRUE(reported<wire::TrackerPosQuat>().empty());
  tick_.device.orientation = Eigen::AngleAxisd(0.021, Vec3::UnitX());
  step();
  EXPECT_EQ(reported<wire::TrackerPosQuat>().size(), 2U);
}

// A client may have its world in metres, or in micrometres: the same motions are reported to it.
TEST_F(ReporterTest, TolerancesAreLengthsOfTheDevice) {
  for (const double worldUnitsPerMetre : {1.0, 1e6}) {
    reporter_.reset();
    tick_.T_world_device = Affine(Eigen::UniformScaling<double>(worldUnitsPerMetre));
    tick_.rendering.proxy_m = tick_.device.position_m = Vec3::Zero();
    touch(0.002);
    step();
    tick_.rendering.proxy_m = tick_.device.position_m = Vec3(0.0009, 0, 0);
    tick_.rendering.depth_m = 0.002009;
    step();
    EXPECT_TRUE(reported<wire::TrackerPosQuat>().empty());
    EXPECT_TRUE(reported<wire::TrackerVelocity>().empty());
    EXPECT_TRUE(reported<wire::Dop>().empty());
    tick_.rendering.proxy_m = tick_.device.position_m = Vec3(0.0011, 0, 0);
    tick_.rendering.depth_m = 0.002011;
    step();
    EXPECT_EQ(reported<wire::TrackerPosQuat>().size(), 2U);
    EXPECT_EQ(reported<wire::TrackerVelocity>().size(), 1U);
    EXPECT_EQ(reported<wire::Dop>().size(), 1U);
  }
}

TEST_F(ReporterTest, ZeroToleranceMeansEveryPeriod) {
  config_.linearTolerance_m = 0;
  step();
  step();
  EXPECT_EQ(reported<wire::TrackerPosQuat>().size(), 2U);
}

TEST_F(ReporterTest, ContactIsReportedOnChange) {
  step();
  touch();
  tick_.device.orientation =
      Eigen::AngleAxisd(M_PI / 3, Vec3::UnitX());  // +Y of the stylus 30 degrees off +Z
  step();
  EXPECT_EQ(reported<wire::TouchedObject>().at(0).object, 3);
  EXPECT_NEAR(reported<wire::Angle>().at(0).angle, 30, 1e-9);
  EXPECT_EQ(reported<wire::Angle>().at(0).touching, 1);
  EXPECT_EQ(reported<wire::Scp>().size(), 1U);
  EXPECT_EQ(reported<wire::IsTouching>().at(0).touching, 1);
  step();
  EXPECT_EQ(out_.size(), 1U);  // nothing changed: isTouching alone
  tick_.force_N.x() += 0.0009;
  tick_.rendering.depth_m += 0.9e-5;
  step();
  EXPECT_TRUE(reported<wire::Force>().empty());
  EXPECT_TRUE(reported<wire::Dop>().empty());
  tick_.force_N.x() += 0.0002;
  tick_.rendering.depth_m += 0.2e-5;
  step();
  EXPECT_EQ(reported<wire::Force>().size(), 1U);
  EXPECT_EQ(reported<wire::Dop>().size(), 1U);
}

// Of several touched objects, the one that pushes hardest gives all: the directions in between are of none.
TEST_F(ReporterTest, PointAndAngleAreThoseOfTheTouchedObject) {
  touch();
  realtime::Rendering& rendering = tick_.rendering;
  rendering.normal = Vec3(1, 0, 1).normalized();
  rendering.scp_m = Vec3(0.0003, 0, 0.0003);
  rendering.contactCount = 2;
  rendering.contacts[0] = {.object = 5,
                           .triangle = 0,
                           .point_m = Vec3(0, 0, 0.001),
                           .normal = Vec3::UnitX(),
                           .force_N = Vec3::UnitX()};
  rendering.contacts[1] = {.object = 3,
                           .triangle = 0,
                           .point_m = Vec3(0.001, 0, 0),
                           .normal = Vec3::UnitY(),
                           .force_N = Vec3::UnitY()};
  step();
  EXPECT_EQ(reported<wire::TouchedObject>().at(0).object, 3);
  EXPECT_NEAR(reported<wire::Angle>().at(0).angle, 0, 1e-9);
  EXPECT_EQ(reported<wire::Scp>().at(0).position, (wire::F64x3{0.001, 0, 0}));
  EXPECT_EQ(reported<wire::TrackerPosQuat>().at(2).position, (wire::F64x3{0.001, 0, 0}));
}

// As a datagram it may have been lost, and nothing else would tell the client.
TEST_F(ReporterTest, TheLastChangeOfAValueIsSentOnceMoreAndReliably) {
  step();
  touch();
  step();
  EXPECT_FALSE(isReliable<wire::Force>());
  std::map<wire::MessageKind, int> reliable;
  for (int i = 0; i < 2000; ++i) {
    step();
    for (const Outgoing& out : out_) reliable[out.message.kind()] += out.reliable ? 1 : 0;
    EXPECT_TRUE(i >= 298 || reported<wire::Force>().empty()) << i;
  }
  EXPECT_EQ(reliable[wire::kindOf<wire::Force>], 1);
  EXPECT_EQ(reliable[wire::kindOf<wire::Dop>], 1);
  EXPECT_EQ(reliable[wire::kindOf<wire::TouchedObject>], 1);
  EXPECT_EQ(reliable[wire::kindOf<wire::Angle>], 1);
  EXPECT_EQ(reliable[wire::kindOf<wire::Scp>], 1);
  EXPECT_EQ(reliable[wire::kindOf<wire::TrackerPosQuat>], 3) << "of each sensor";
  EXPECT_EQ(reliable[wire::kindOf<wire::AnalogChannels>], 1);
  // A force that varies is told all the time.
  for (int i = 0; i < 1000; ++i) {
    tick_.force_N.x() += 0.01;
    step();
    EXPECT_FALSE(isReliable<wire::Force>());
  }
}

TEST_F(ReporterTest, TheTransitionToZeroForceIsReported) {
  tick_.force_N = Vec3(0.0015, 0, 0);
  step();
  EXPECT_EQ(reported<wire::Force>().size(), 1U);
  tick_.force_N = Vec3(0.0007, 0, 0);
  step();
  EXPECT_TRUE(reported<wire::Force>().empty());
  tick_.force_N = Vec3::Zero();
  step();
  ASSERT_EQ(reported<wire::Force>().size(), 1U);
  EXPECT_EQ(reported<wire::Force>()[0].force, (wire::F64x3{0, 0, 0}));
  step();
  EXPECT_TRUE(reported<wire::Force>().empty());
}

// Long before the next report period, and when it is due.
TEST_F(ReporterTest, TheEndOfAContactIsReliableAndComplete) {
  for (const double rate_Hz : {1000, 10}) {
    reporter_.reset();
    config_.reportRate_Hz = rate_Hz;
    touch();
    step();
    tick_.rendering = {};
    tick_.force_N = Vec3::Zero();
    step();
    EXPECT_EQ(reported<wire::Force>().at(0).force, (wire::F64x3{0, 0, 0}));
    EXPECT_EQ(reported<wire::Dop>().at(0).depth, 0);
    EXPECT_EQ(reported<wire::TouchedObject>().at(0).object, -1);
    EXPECT_EQ(reported<wire::Angle>().at(0).touching, 0);
    EXPECT_TRUE(isReliable<wire::Force>() && isReliable<wire::Dop>() && isReliable<wire::TouchedObject>() &&
                isReliable<wire::Angle>())
        << rate_Hz;
  }
  step();
  EXPECT_TRUE(out_.empty());
}

// A touch may be shorter than a report period.
TEST_F(ReporterTest, BeginAndEndOfAContactAreReportedBetweenTwoPeriodsAndDoNotMoveThem) {
  config_.reportRate_Hz = 100;
  std::vector<int> at;
  for (int i = 0; i < 45; ++i) {
    if (i == 13 || i == 33) touch();
    if (i == 16 || i == 33 + 2) {
      tick_.rendering = {};
      tick_.force_N = Vec3::Zero();
    }
    step();
    if (reported<wire::IsTouching>().empty()) continue;
    at.push_back(i);
    if (i == 13 || i == 33) {
      EXPECT_EQ(reported<wire::IsTouching>()[0].touching, 1);
      EXPECT_TRUE(isReliable<wire::IsTouching>());
      EXPECT_EQ(reported<wire::TouchedObject>().at(0).object, 3);
      EXPECT_EQ(reported<wire::Angle>().at(0).touching, 1);
      for (const Outgoing& out : out_) EXPECT_TRUE(out.reliable) << "the end may come before a datagram";
    }
  }
  EXPECT_EQ(at, (std::vector<int>{0, 10, 13, 16, 20, 30, 33, 35, 40}));
}

TEST_F(ReporterTest, TheReportRateIsKeptAndButtonsAreReportedAtOnce) {
  config_.reportRate_Hz = 100;
  step();
  int periods = 0;
  for (int i = 0; i < 1000; ++i) {
    step();
    periods += static_cast<int>(reported<wire::IsTouching>().size());
  }
  EXPECT_NEAR(periods, 100, 1);
  step();
  tick_.device.buttons = 2;
  step();
  ASSERT_EQ(reported<wire::ButtonChange>().size(), 1U);
  EXPECT_EQ(reported<wire::ButtonChange>()[0].button, 1);
  EXPECT_EQ(reported<wire::ButtonChange>()[0].state, 1);
}

TEST_F(ReporterTest, TheFirstReportBeginsTheIntervals) {
  config_.reportRate_Hz = 100;
  std::vector<int> at;
  for (int i = 0; i < 45; ++i) {
    step();
    if (!reported<wire::IsTouching>().empty()) at.push_back(i);
  }
  EXPECT_EQ(at, (std::vector<int>{0, 10, 20, 30, 40}));
}

// Ticks begin some microseconds early or late.
TEST_F(ReporterTest, EveryTickIsReportedAtTheServoRate) {
  for (const Nanos first : {Nanos{0}, kMs}) {
    reporter_.reset();
    step(first + kMs);
    ASSERT_EQ(reported<wire::IsTouching>().size(), 1U);
    Nanos late = 0;
    for (const Nanos next : {-5'000, -5'000, 20'000, -200'000, 300'000, 0, -300'000, -5'000, 0}) {
      step(kMs + next - late);
      late = next;
      EXPECT_EQ(reported<wire::IsTouching>().size(), 1U) << next << " ns late";
    }
  }
}

TEST_F(ReporterTest, SlowIntervalsDoNotDriftWithEarlyTicks) {
  config_.reportRate_Hz = 100;
  std::vector<int> at;
  for (int i = 0; i < 45; ++i) {
    step(i % 10 == 1 ? kMs + 5'000 : i % 10 == 0 && i > 0 ? kMs - 5'000 : kMs);
    if (!reported<wire::IsTouching>().empty()) at.push_back(i);
  }
  EXPECT_EQ(at, (std::vector<int>{0, 10, 20, 30, 40}));
}

TEST_F(ReporterTest, OptionsSelectForceAndQuaternionOrder) {
  config_.forceReport = ForceReport::normal;
  config_.quaternionOrder = QuaternionOrder::wxyz;
  touch();
  step();
  EXPECT_EQ(reported<wire::Force>().at(0).force, (wire::F64x3{0, 0, 1}));
  EXPECT_EQ(reported<wire::TrackerPosQuat>().at(0).orientation, (wire::F64x4{1, 0, 0, 0}));
}

TEST_F(ReporterTest, TripsAndRecoveryAreReportedOnce) {
  step();
  tick_.guard.active = realtime::bit(realtime::Trip::speed) | realtime::bit(realtime::Trip::slew);
  step();
  ASSERT_EQ(reported<wire::ForceError>().size(), 1U);  // a clamp is not an error
  EXPECT_EQ(reported<wire::ForceError>()[0].code, 2);
  step();
  EXPECT_TRUE(reported<wire::ForceError>().empty());
  tick_.guard.active = 0;
  step();
  ASSERT_EQ(reported<wire::ForceError>().size(), 1U);
  EXPECT_EQ(reported<wire::ForceError>()[0].code, 4);
}

TEST_F(ReporterTest, ALateClientGetsThePresentState) {
  touch();
  tick_.device.buttons = 1;
  for (int i = 0; i < 3; ++i) step();
  out_.clear();
  reporter_->presentState(tick_, frame_, out_);
  EXPECT_EQ(reported<wire::ButtonStates>().at(0).states.values, (std::vector<std::int32_t>{1, 0, 1}));
  EXPECT_EQ(reported<wire::TrackerPosQuat>().size(), 3U);
  EXPECT_EQ(reported<wire::TouchedObject>().at(0).object, 3);
  EXPECT_EQ(reported<wire::IsTouching>().at(0).touching, 1);
  EXPECT_EQ(reported<wire::Force>().size(), 1U);
  EXPECT_EQ(reported<wire::Dop>().size(), 1U);
  EXPECT_EQ(reported<wire::Scp>().size(), 1U);
  EXPECT_EQ(reported<wire::Angle>().size(), 1U);
  for (const Outgoing& out : out_) EXPECT_TRUE(out.reliable);
}

TEST_F(ReporterTest, ContactIsMirroredAsAnalogChannelsAndAButton) {
  touch(0.002);
  step();
  const auto channels = reported<wire::AnalogChannels>().at(0).channels.values;
  ASSERT_EQ(channels.size(), 6U);
  EXPECT_NEAR(channels[0], 0.1, 1e-12);
  EXPECT_NEAR(channels[2], 1.0, 1e-12);
  EXPECT_NEAR(channels[3], 0.002, 1e-12);
  EXPECT_NEAR(channels[4], 90, 1e-9);
  EXPECT_EQ(channels[5], 3);
  ASSERT_EQ(reported<wire::ButtonChange>().size(), 1U);
  EXPECT_EQ(reported<wire::ButtonChange>()[0].button, 2);  // after the device's own two
  EXPECT_EQ(reported<wire::ButtonChange>()[0].state, 1);
  step();
  EXPECT_TRUE(reported<wire::AnalogChannels>().empty());  // nothing changed
  tick_.rendering = {};
  tick_.force_N = Vec3::Zero();
  step();
  EXPECT_EQ(reported<wire::AnalogChannels>().at(0).channels.values, (std::vector<double>{0, 0, 0, 0, 0, -1}));
  EXPECT_TRUE(isReliable<wire::AnalogChannels>());
  EXPECT_EQ(reported<wire::ButtonChange>().at(0).state, 0);
}

TEST_F(ReporterTest, AGripperIsTheAnalogChannelAfterTheContact) {
  const auto gripper = [&]() -> std::optional<double> {
    const auto channels = reported<wire::AnalogChannels>();
    if (channels.size() != 1 || channels[0].channels.values.size() != 7) return std::nullopt;
    return channels[0].channels.values[6];
  };
  tick_.device.gripper_rad = 0.3;
  step();
  EXPECT_EQ(gripper(), 0.3) << "without any contact";
  tick_.device.gripper_rad = 0.3005;
  step();
  EXPECT_TRUE(reported<wire::AnalogChannels>().empty()) << "less than a milliradian";
  tick_.device.gripper_rad = 0.2985;
  step();
  EXPECT_EQ(gripper(), 0.2985);
  touch();
  step();
  EXPECT_EQ(gripper(), 0.2985) << "with the contact's channels";
  tick_.rendering = {};
  tick_.device.gripper_rad = 0.1;
  step();
  EXPECT_EQ(gripper(), 0.1) << "at the end of the contact";
  step();
  EXPECT_TRUE(reported<wire::AnalogChannels>().empty());
  std::vector<Outgoing> late;
  reporter_->presentState(tick_, frame_, late);
  out_ = late;
  EXPECT_EQ(gripper(), 0.1) << "for a late client";
  choice_.kinds = wire::kReportForce;
  start();
  step();
  EXPECT_TRUE(reported<wire::AnalogChannels>().empty()) << "analog reports are not subscribed";
}

TEST_F(ReporterTest, WithoutSubscriptionThereIsOneSensorAndNoMirror) {
  choice_ = defaultChoice(config_);
  tick_.device.buttons = 1;
  tick_.device.gripper_rad = 0.3;
  step();
  touch();
  tick_.rendering.proxy_m = tick_.device.position_m = Vec3(0.01, 0, 0);
  step();
  ASSERT_EQ(reported<wire::TrackerPosQuat>().size(), 1U);
  EXPECT_EQ(reported<wire::TrackerPosQuat>()[0].sensor, kSensorProxy);
  ASSERT_EQ(reported<wire::TrackerVelocity>().size(), 1U);
  EXPECT_EQ(reported<wire::TrackerVelocity>()[0].sensor, kSensorProxy);
  EXPECT_TRUE(reported<wire::ButtonChange>().empty());
  EXPECT_TRUE(reported<wire::AnalogChannels>().empty());
  out_.clear();
  reporter_->presentState(tick_, frame_, out_);
  EXPECT_EQ(reported<wire::ButtonStates>().at(0).states.values, (std::vector<std::int32_t>{1, 0}));
  EXPECT_EQ(reported<wire::AnalogChannels>().at(0).channels.values, (std::vector<double>{0.3}));
}

TEST_F(ReporterTest, CompatMirrorsRestoreEverySensorAndTheMirrors) {
  config_.compatMirrors = true;
  EXPECT_EQ(defaultChoice(config_).kinds, choice_.kinds);
  EXPECT_EQ(withMirrors(config_, {.kinds = wire::kReportTick, .rate_Hz = 1}).kinds, wire::kReportTick);
}

TEST_F(ReporterTest, ALateTickReportsEventsOnlyAndTheNextOneReportsTheRest) {
  step();
  touch();
  step();
  ASSERT_EQ(reported<wire::IsTouching>().size(), 1U);
  EXPECT_TRUE(isReliable<wire::IsTouching>()) << "contact begins";
  tick_.force_N.x() += 1;
  tick_.device.buttons = 1;
  skip();
  ASSERT_EQ(out_.size(), 1U) << "the button";
  EXPECT_EQ(reported<wire::ButtonChange>().at(0).state, 1);
  EXPECT_EQ(reporter_->takeSkipped(), 1U);
  EXPECT_EQ(reporter_->takeSkipped(), 0U);
  step();
  EXPECT_EQ(reported<wire::Force>().size(), 1U) << "changed in the skipped tick";
  tick_.rendering = {};
  tick_.force_N = Vec3::Zero();
  skip();
  EXPECT_EQ(reported<wire::IsTouching>().at(0).touching, 0) << "the end of a contact is never skipped";
  EXPECT_TRUE(isReliable<wire::Force>());
  EXPECT_EQ(reporter_->takeSkipped(), 0U);
}

TEST_F(ReporterTest, ATickThatIsNotDueIsNotCountedAsSkipped) {
  config_.reportRate_Hz = 10;
  step();
  skip();
  EXPECT_EQ(reporter_->takeSkipped(), 0U);
}

TEST(FreshTicks, AffordsAsManyAsAreQuicklySent) {
  FreshTicks fresh(1000);
  EXPECT_EQ(fresh.affordable(), 12U) << "the rest is older than 12 ms";
  fresh.tickTook(kMs / 10);
  for (int i = 0; i < 7; ++i) fresh.tickTook(kMs);
  EXPECT_EQ(fresh.affordable(), 12U) << "one fast pass of the last eight: no load, but a preemption";
  fresh.tickTook(kMs);
  EXPECT_EQ(fresh.affordable(), 3U);
  for (int i = 0; i < 8; ++i) fresh.flushTook(2 * kMs);
  EXPECT_EQ(fresh.affordable(), 1U);
  for (int i = 0; i < 8; ++i) fresh.flushTook(30 * kMs);
  EXPECT_EQ(fresh.affordable(), 1U) << "the newest is always reported";
}

TEST_F(ReporterTest, OnlySubscribedKindsAreReported) {
  choice_.kinds = wire::kReportTouchButton;
  touch();
  step();
  EXPECT_EQ(reported<wire::ButtonChange>().size(), 1U);
  EXPECT_EQ(out_.size(), 1U);
  tick_.guard.active = realtime::bit(realtime::Trip::speed);
  step();
  EXPECT_EQ(reported<wire::ForceError>().size(), 1U);  // errors are always reported
}

TEST_F(ReporterTest, ATickReportUsesTheUnitsOfTheOtherReports) {
  choice_.kinds = wire::kReportTick;
  tick_.T_world_device = Eigen::Translation3d(500, 0, 0) * Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()) *
                         Eigen::UniformScaling<double>(2000.0);
  tick_.rendering.proxy_m = Vec3(0.01, 0, 0);
  tick_.device.position_m = Vec3(0.02, 0, 0);
  tick_.device.velocity_m_per_s = Vec3(0.1, 0, 0);
  tick_.device.buttons = 2;
  tick_.revision = 7;
  touch(0.002);
  step();
  ASSERT_EQ(out_.size(), 1U);
  const wire::TickReport whole = reported<wire::TickReport>().at(0);
  EXPECT_EQ(whole.tick, 1U);
  EXPECT_EQ(whole.time, kMs);
  EXPECT_EQ(whole.revision, 7U);
  EXPECT_NEAR(whole.proxy[1], 0.02, 1e-12);
  EXPECT_NEAR(whole.hand[1], 0.04, 1e-12);
  EXPECT_NEAR(whole.velocity[1], 0.2, 1e-12);
  EXPECT_NEAR(whole.force[1], 0.1, 1e-12);
  EXPECT_NEAR(whole.depth, 0.004, 1e-12);
  EXPECT_EQ(whole.object, 3);
  EXPECT_EQ(whole.buttons, 2U);
}

TEST_F(ReporterTest, EveryContactOfATickIsListedAndTheEndIsAnEmptyList) {
  choice_.kinds = wire::kReportContacts;
  step();
  EXPECT_TRUE(out_.empty());
  touch();
  tick_.rendering.contactCount = 2;
  tick_.rendering.contacts[0] = {4, 1, Vec3(0.01, 0, 0), Vec3::UnitX(), Vec3(2, 0, 0)};
  tick_.rendering.contacts[1] = {5, 1, Vec3(0, 0.01, 0), Vec3::UnitY(), Vec3(0, 3, 0)};
  step();
  const auto numbers = reported<wire::ContactList>().at(0).contacts.values;
  EXPECT_EQ(numbers, (std::vector<double>{4, 0.01, 0,    0, 1, 0, 0, 2, 0, 0,  //
                                          5, 0,    0.01, 0, 0, 1, 0, 0, 3, 0}));
  tick_.rendering = {};
  step();
  EXPECT_TRUE(reported<wire::ContactList>().at(0).contacts.values.empty());
  EXPECT_TRUE(isReliable<wire::ContactList>());
  step();
  EXPECT_TRUE(out_.empty());
}

// A plane that adheres pulls after the touch, too.
TEST_F(ReporterTest, TheEndOfATouchIsAnEmptyListAlsoWhereAPlaneStillPulls) {
  choice_.kinds = wire::kReportContacts;
  touch();
  step();
  ASSERT_EQ(reported<wire::ContactList>().size(), 1U);
  tick_.rendering = {};
  tick_.rendering.contactCount = 1;
  tick_.rendering.contacts[0] = {-1, 0, Vec3::Zero(), Vec3::UnitZ(), Vec3(0, 0, -0.1)};
  step();
  ASSERT_EQ(reported<wire::ContactList>().size(), 1U);
  EXPECT_TRUE(reported<wire::ContactList>().at(0).contacts.values.empty());
  step();
  EXPECT_TRUE(out_.empty());
}

TEST_F(ReporterTest, AllOf32ButtonsAreReported) {
  choice_.kinds = wire::kReportHand;
  choice_.rate_Hz = config_.reportRate_Hz;
  reporter_ = std::make_unique<Reporter>(config_, 32, choice_);
  tick_.device.buttons = 0x80000001U;
  step();
  EXPECT_EQ(reported<wire::HandState>().at(0).buttons, 0x80000001U);
}

TEST_F(ReporterTest, TheHandsStateHasTheRemoteContacts) {
  choice_.kinds = wire::kReportHand;
  tick_.T_world_device = Affine(Eigen::UniformScaling<double>(2000.0));
  tick_.T_world_device.rotate(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()));
  tick_.device.position_m = Vec3(0.02, 0, 0);
  tick_.device.buttons = 1;
  tick_.device.gripper_rad = 0.4;
  tick_.force_N = Vec3(3, 0, 0);
  tick_.remote.heldForce_N = Vec3(1, 0, 0);
  tick_.remote.energy_J = 0.01;
  tick_.remote.contactsTime = 11;
  tick_.remote.forceTime = 12;
  tick_.remote.status = realtime::kRemoteEnergySpent;
  tick_.remote.count = 1;
  tick_.remote.contacts[0] = {9, geometry::Vec3f(0.5F, 0, 0), geometry::Vec3f(2, 0, 0), 0.25F};
  step();
  ASSERT_EQ(out_.size(), 1U);
  const wire::HandState state = reported<wire::HandState>().at(0);
  EXPECT_EQ(state.tick, 1U);
  EXPECT_EQ(state.contactsTime, 11);
  EXPECT_EQ(state.forceTime, 12);
  EXPECT_NEAR(state.position[1], 0.04, 1e-12);
  EXPECT_NEAR(state.force[1], 3, 1e-12);
  EXPECT_NEAR(state.heldForce[1], 1, 1e-12);
  EXPECT_EQ(state.energy, 0.01);
  EXPECT_EQ(state.gripper, 0.4);
  EXPECT_EQ(state.buttons, 1U);
  EXPECT_EQ(state.flags, wire::kHandHasGripper | wire::kHandEnergySpent);
  const std::vector<double> expected{9, 0, 1, 0, 0, 2, 0, 0.5};
  ASSERT_EQ(state.contacts.values.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_NEAR(state.contacts.values[i], expected[i], 1e-9) << i;
}

TEST_F(ReporterTest, PosesAreRelativeToTheOrigin) {
  config_.linearTolerance_m = 0;
  tick_.rendering.proxy_m = Vec3(0.03, 0.01, 0);
  tick_.device.orientation = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ());
  frame_.origin = Vec3(0.02, 0.01, 0);
  frame_.rotation = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ());
  step();
  const auto pose = reported<wire::TrackerPosQuat>().at(0);
  EXPECT_NEAR(pose.position[0], 0, 1e-12);
  EXPECT_NEAR(pose.position[1], -0.01, 1e-12);  // 10 mm along x in a frame that is rotated to +y
  EXPECT_NEAR(std::abs(pose.orientation[3]), 1, 1e-12);
}

TEST_F(ReporterTest, TheGuardIsReportedOnChange) {
  const auto states = [this] { return reported<wire::GuardState>(); };
  tick_.guard.armed = true;
  step();
  ASSERT_EQ(states().size(), 1U);
  EXPECT_EQ(states()[0].armed, 1);
  tick_.guard.active = realtime::bit(realtime::Trip::slew);
  step();
  EXPECT_TRUE(states().empty());  // a clamp
  tick_.guard.stopped = true;
  tick_.guard.active = realtime::bit(realtime::Trip::stopped);
  step();
  ASSERT_EQ(states().size(), 1U);
  EXPECT_EQ(states()[0].stopped, 1);
  EXPECT_EQ(states()[0].active, realtime::bit(realtime::Trip::stopped));
}

}  // namespace
}  // namespace hapticd::server

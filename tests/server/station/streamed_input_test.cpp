// From the wire to the servo: frames, limits, bounds, owners.
#include "server/station/streamed_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/time.h"
#include "realtime/remote/remote_shape.h"

namespace hapticd::server {
namespace {

using geometry::Vec3;
using testing::HasSubstr;

constexpr base::Nanos kStreamMillisecond = 1'000'000;

class StreamedInputTest : public testing::Test {
 protected:
  // A floor at a height in reported metres.
  static std::vector<double> floorAt(double y, double id = 0) {
    return {id, 0, 0, 0, y, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 500, 1, 0.4, 0.3, 0.1, 0};
  }
  StreamedInput::Answer send(std::vector<double> numbers, scene::ClientId client = 1, std::int64_t time = 0,
                             std::int64_t stateTime = 0) {
    wire::RemoteContacts message{.time = time, .stateTime = stateTime, .contacts = {}};
    message.contacts.values = std::move(numbers);
    return streamed_.on(client, message, last_, now_);
  }
  StreamedInput::Answer hold(const wire::F64x3& force, scene::ClientId client = 1) {
    return streamed_.on(client, wire::HeldForce{.time = 0, .force = force, .torque = {}, .lifetime = 0.05},
                        last_, now_);
  }
  const realtime::RemoteContact& first() { return slot_.read().contacts.contacts[0]; }

  static scene::SceneConfig config() {
    scene::SceneConfig config;
    config.ownDamping_Ns_per_m = 5;
    return config;
  }
  StreamedInput::Slot slot_;
  StreamedInput streamed_{slot_, config(), {}, false};
  realtime::TickReport last_;
  base::Nanos now_ = 5000 * kStreamMillisecond;
};

TEST_F(StreamedInputTest, ConvertsToTheFrameOfTheDevice) {
  EXPECT_TRUE(send(floorAt(0.01)).taken);
  EXPECT_NEAR((first().point_m - Vec3(0, 0.01, 0)).norm(), 0, 1e-12) << "before the first tick: millimetres";
  EXPECT_NEAR((first().normal - Vec3::UnitY()).norm(), 0, 1e-12);
  EXPECT_EQ(first().lifetime, 100 * kStreamMillisecond);
  EXPECT_EQ(slot_.read().contacts.received, now_);

  // A world twice as large as the travel of the device, turned by 90 degrees about z.
  last_.tick = 1;
  last_.T_world_device = geometry::Affine(Eigen::UniformScaling<double>(2000.0));
  last_.T_world_device.rotate(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()));
  std::vector<double> ball = floorAt(0.01);
  ball[1] = 1;
  ball[2] = 0.02;
  ball[12] = 0.2;
  ball[17] = 3;
  EXPECT_TRUE(send(ball).taken);
  EXPECT_NEAR((first().point_m - Vec3(0.005, 0, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((first().normal - Vec3::UnitX()).norm(), 0, 1e-12);
  EXPECT_NEAR(first().radius_m, 0.01, 1e-12);
  EXPECT_NEAR((first().velocity_m_per_s - Vec3(0, -0.1, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((first().angularVelocity_rad_per_s - Vec3(0, 0, 3)).norm(), 0, 1e-12);
  EXPECT_EQ(first().stiffness_N_per_m, 500);
  EXPECT_TRUE(hold({1, 2, 0}).taken);
  EXPECT_NEAR((slot_.read().force.force_N - Vec3(2, -1, 0)).norm(), 0, 1e-12);
}

TEST_F(StreamedInputTest, LimitsWhatIsTooFastTooLongOrTooStiff) {
  std::vector<double> n = floorAt(0);
  n[12] = 3;
  n[15] = 100;
  n[18] = 1e6;
  n[20] = 7;
  n[21] = 8;
  n[22] = 5;
  const StreamedInput::Answer answer = send(n);
  EXPECT_TRUE(answer.taken);
  EXPECT_THAT(answer.text.text, HasSubstr("unstable"));
  EXPECT_THAT(answer.text.text, HasSubstr("; damping"));
  EXPECT_THAT(answer.text.text, testing::Not(testing::EndsWith("; ")));
  EXPECT_EQ(answer.text.code, RefusalCode::none);
  EXPECT_NEAR(first().velocity_m_per_s.norm(), 1, 1e-12);
  EXPECT_NEAR(first().angularVelocity_rad_per_s.norm(), 20, 1e-9);
  EXPECT_NEAR(first().stiffness_N_per_m, 0.999 * 5 / 0.0005, 1e-6);
  EXPECT_EQ(first().staticFriction, 1);
  EXPECT_EQ(first().dynamicFriction, 1);
  EXPECT_EQ(first().lifetime, 100 * kStreamMillisecond);
}

TEST_F(StreamedInputTest, AWheelThatIsTooFastStillTurnsAboutItsCentre) {
  for (const double turning : {15.0, 30.0}) {
    std::vector<double> wheel = floorAt(0);
    wheel[1] = 2;
    wheel[2] = 0.1;
    wheel[10] = 0;
    wheel[11] = 1;
    wheel[12] = -turning * 0.1 + 0.2;  // its centre moves at 0.2 m/s
    wheel[17] = turning;
    ASSERT_TRUE(send(wheel).taken);
    const Vec3 rim = first().angularVelocity_rad_per_s.cross(first().radius_m * first().normal);
    EXPECT_NEAR((first().velocity_m_per_s - rim - Vec3(0.2, 0, 0)).norm(), 0, 1e-9) << turning << " rad/s";
    EXPECT_NEAR(first().angularVelocity_rad_per_s.norm(), std::min(turning, 20.0), 1e-9);
  }
}

TEST_F(StreamedInputTest, AFlatSurfaceIsLimitedWhereTheHandIs) {
  last_.device.position_m = {0.01, 0.02, 0};
  std::vector<double> floor = floorAt(0);
  floor[3] = -0.1;  // a hinge, about which the floor rises under the hand at 0.55 m/s
  floor[17] = 5;
  ASSERT_TRUE(send(floor).taken);
  EXPECT_NEAR(first().velocity_m_per_s.norm(), 0, 1e-12);
  floor[3] = -100;
  for (const double turning : {1.0, 5.0, 50.0}) {
    floor[17] = turning;
    ASSERT_TRUE(send(floor).taken);
    const realtime::SurfaceAt at = realtime::surfaceAt(first(), 0, last_.device.position_m);
    EXPECT_NEAR(at.velocity_m_per_s.norm(), 1, 1e-9) << turning << " rad/s";
    EXPECT_NEAR(first().angularVelocity_rad_per_s.norm(), std::min(turning, 20.0), 1e-9);
  }
}

// Delay bounds the stiffness of what follows the hand, and of that alone.
TEST_F(StreamedInputTest, AYieldingContactPaysForTheRoundTrip) {
  std::vector<double> n = floorAt(0);
  n[18] = 5000;
  send(n, 1, 0, now_ - 40 * kStreamMillisecond);
  EXPECT_EQ(first().stiffness_N_per_m, 5000);
  n[23] = 1;
  send(n, 1, 0, now_ - 40 * kStreamMillisecond);
  EXPECT_NEAR(first().stiffness_N_per_m, 0.999 * 5 / 0.0405, 1e-6);
  // Surfaces from two sides share the bound.
  n[23] = 0;
  n[18] = 1e5;
  std::vector<double> both = n;
  n[0] = 1;
  n[7] = -2;
  both.insert(both.end(), n.begin(), n.end());
  send(both);
  EXPECT_NEAR(first().stiffness_N_per_m, 0.999 * 2.5 / 0.0005, 1e-6);
}

TEST_F(StreamedInputTest, OneLateMessageIsNoRoundTrip) {
  std::vector<double> n = floorAt(0);
  n[18] = 400;
  n[23] = 1;
  const auto sendAged = [&](int age_ms) {
    now_ += 33 * kStreamMillisecond;
    send(n, 1, 0, now_ - age_ms * kStreamMillisecond);
    return first().stiffness_N_per_m;
  };
  for (int i = 0; i < 10; ++i) EXPECT_EQ(sendAged(10), 400);
  EXPECT_EQ(sendAged(100), 400);
  for (int i = 0; i < 150; ++i) EXPECT_EQ(sendAged(10), 400);
  sendAged(100);
  EXPECT_NEAR(sendAged(100), 0.999 * 5 / 0.1005, 1e-6) << "a way that has become longer";
  EXPECT_LT(sendAged(10), 70) << "it may become so again";
  for (int i = 0; i < 90; ++i) sendAged(10);
  EXPECT_EQ(sendAged(10), 400) << "after three seconds, whatever the rate of the client";
}

// Only what both press on the hand at once share the bound.
// After a pause of the network, TCP delivers all that waited at once; the servo feels the last of it.
TEST_F(StreamedInputTest, ABurstAfterAPauseIsOneMessage) {
  std::vector<double> n = floorAt(0);
  n[18] = 400;
  n[23] = 1;
  const base::Nanos start = now_;
  const auto sendAll = [&](int from_ms, int until_ms, int arrived_ms, int apart_us = 16) {
    for (int ms = from_ms; ms < until_ms; ms += 16) {
      now_ = start + std::max(ms + 5, arrived_ms) * kStreamMillisecond;
      if (ms + 5 < arrived_ms) now_ += (ms - from_ms) / 16 * apart_us * 1000;
      send(n, 1, 0, start + (ms - 5) * kStreamMillisecond);
    }
    return first().stiffness_N_per_m;
  };
  EXPECT_EQ(sendAll(0, 400, 0), 400);
  EXPECT_EQ(sendAll(400, 560, 555), 400);
  EXPECT_EQ(sendAll(560, 20'000, 0), 400);
  // A slow line spreads the burst.
  EXPECT_EQ(sendAll(20'000, 20'160, 20'155, 1500), 400);
  EXPECT_EQ(sendAll(20'176, 20'400, 0), 400);
}

// Of a fast stream it is hardly faster than it was made.
TEST_F(StreamedInputTest, ABurstOfAFastStreamIsOneMessage) {
  std::vector<double> n = floorAt(0);
  n[18] = 400;
  n[23] = 1;
  const base::Nanos start = now_;
  const auto sendAt = [&](base::Nanos arrived, int ms) {
    now_ = start + arrived;
    send(n, 1, 0, start + (ms - 5) * kStreamMillisecond);
  };
  for (int ms = 0; ms < 400; ++ms) sendAt((ms + 5) * kStreamMillisecond, ms);
  for (int i = 0; i < 6; ++i) sendAt(555 * kStreamMillisecond + i * 600'000, 400 + i);
  EXPECT_EQ(first().stiffness_N_per_m, 400);
}

TEST_F(StreamedInputTest, FacingSurfacesShareTheBoundWhereTheyMaySqueezeTheHand) {
  const auto stiffnessOfFloorUnder = [&](double ceiling_m, double sinking_m_per_s = 0) {
    std::vector<double> n = floorAt(0, 1);
    std::vector<double> ceiling = floorAt(ceiling_m, 2);
    n[18] = ceiling[18] = 1e5;
    ceiling[7] = -1;
    ceiling[13] = -sinking_m_per_s;
    ceiling[3] = 0.05;  // any of its points
    n.insert(n.end(), ceiling.begin(), ceiling.end());
    send(n);
    return first().stiffness_N_per_m;
  };
  const double whole = 0.999 * 5 / 0.0005;
  EXPECT_NEAR(stiffnessOfFloorUnder(0.020), whole, 1e-6);
  EXPECT_NEAR(stiffnessOfFloorUnder(0.002), whole / 2, 1e-6);
  EXPECT_NEAR(stiffnessOfFloorUnder(-0.002), whole / 2, 1e-6);
  EXPECT_NEAR(stiffnessOfFloorUnder(0.020, 0.5), whole / 2, 1e-6) << "they meet within their life";
}

// What counts is how they face each other at the hand, whichever of their points the client names.
TEST_F(StreamedInputTest, RoundAndTurningSurfacesShareTheBoundWhereTheyFaceTheHand) {
  const double whole = 0.999 * 5 / 0.0005;
  std::vector<double> left = floorAt(0.02, 1);  // named by the topmost point of each ball
  left[1] = 1;
  left[2] = 0.02;
  left[18] = 1e5;
  std::vector<double> right = left;
  right[0] = 2;
  const auto stiffnessWithGap = [&](double gap_m) {
    left[3] = -0.02 - gap_m / 2;
    right[3] = 0.02 + gap_m / 2;
    std::vector<double> both = left;
    both.insert(both.end(), right.begin(), right.end());
    send(both);
    return first().stiffness_N_per_m;
  };
  EXPECT_NEAR(stiffnessWithGap(0.002), whole / 2, 1e-6);
  EXPECT_NEAR(stiffnessWithGap(0.020), whole, 1e-6);
  last_.device.position_m = {0, 0.03, 0};
  EXPECT_NEAR(stiffnessWithGap(0.002), whole, 1e-6) << "above both, they do not face each other";

  // A lid that closes about a hinge, which the client names.
  last_.device.position_m = {0, 0.005, 0};
  std::vector<double> both = floorAt(0, 1);
  std::vector<double> lid = floorAt(0.03, 2);
  both[18] = lid[18] = 1e5;
  lid[3] = -0.1;
  lid[7] = -1;
  const auto stiffnessUnderLid = [&](double turning_rad_per_s) {
    lid[17] = turning_rad_per_s;
    std::vector<double> numbers = both;
    numbers.insert(numbers.end(), lid.begin(), lid.end());
    send(numbers);
    return first().stiffness_N_per_m;
  };
  EXPECT_NEAR(stiffnessUnderLid(0), whole, 1e-6);
  EXPECT_NEAR(stiffnessUnderLid(-5), whole / 2, 1e-6);
  EXPECT_NEAR(stiffnessUnderLid(5), whole, 1e-6) << "it opens";
}

TEST_F(StreamedInputTest, ASurfaceThatFacesTouchedOnesOfTheSceneHasHalfTheBound) {
  const double whole = 0.999 * 5 / 0.0005;
  const auto stiffnessOf = [&](double height_m, const Vec3& normal) {
    std::vector<double> n = floorAt(height_m);
    std::copy_n(normal.data(), 3, n.begin() + 6);
    n[18] = 1e5;
    send(n);
    return first().stiffness_N_per_m;
  };
  EXPECT_NEAR(stiffnessOf(0.002, -Vec3::UnitY()), whole, 1e-6);
  last_.rendering.contactCount = 1;
  last_.rendering.contacts[0].normal = Vec3::UnitY();
  EXPECT_NEAR(stiffnessOf(0.002, -Vec3::UnitY()), whole / 2, 1e-6);
  EXPECT_NEAR(stiffnessOf(0.020, -Vec3::UnitY()), whole, 1e-6) << "far from the hand";
  EXPECT_NEAR(stiffnessOf(0.002, Vec3::UnitX()), whole, 1e-6) << "across";
}

// Across a groove both walls are stiffer than each by the cosine between their normals.
TEST_F(StreamedInputTest, WallsOfAGrooveShareTheBound) {
  const double whole = 0.999 * 5 / 0.0005;
  for (const double degrees : {60.0, 90.0, 100.0, 119.0, 150.0, 180.0}) {
    const double half = 0.5 * degrees * M_PI / 180;
    std::vector<double> both;
    for (const double side : {1.0, -1.0}) {
      std::vector<double> wall = floorAt(0, side);
      wall[6] = side * std::sin(half);
      wall[7] = std::cos(half);
      wall[18] = 1e5;
      both.insert(both.end(), wall.begin(), wall.end());
    }
    send(both);
    const double opposed = std::max(0.0, -std::cos(2 * half));
    EXPECT_NEAR(first().stiffness_N_per_m, whole / (1 + opposed), 1e-6) << degrees << " degrees";
  }
}

TEST_F(StreamedInputTest, AWallSharesTheBoundWithAllThatItFaces) {
  const double whole = 0.999 * 5 / 0.0005;
  const auto stiffnessAgainst = [&](const std::vector<double>& degrees) {
    std::vector<double> all = floorAt(0, 1);
    all[18] = 1e5;
    double id = 2;
    for (const double away : degrees) {
      std::vector<double> wall = floorAt(0, id++);
      wall[6] = std::sin(away * M_PI / 180);
      wall[7] = -std::cos(away * M_PI / 180);
      wall[18] = 1e5;
      all.insert(all.end(), wall.begin(), wall.end());
    }
    send(all);
    return first().stiffness_N_per_m;
  };
  EXPECT_NEAR(stiffnessAgainst({60}), whole / 1.5, 1e-6);
  EXPECT_NEAR(stiffnessAgainst({60, -60}), whole / 2, 1e-6);
  EXPECT_NEAR(stiffnessAgainst({0, 0, 0}), whole / 2, 1e-6) << "on top of each other they are one";
}

TEST_F(StreamedInputTest, RefusesWhatCannotBeUsedAndKeepsTheRest) {
  std::vector<double> n = floorAt(0, 1);
  const std::vector<double> good = floorAt(0.02, 2);
  n[6] = n[7] = n[8] = 0;
  n.insert(n.end(), good.begin(), good.end());
  const StreamedInput::Answer answer = send(n);
  EXPECT_EQ(answer.text.code, RefusalCode::streamInvalid);
  EXPECT_THAT(answer.text.text, HasSubstr("the normal is zero"));
  EXPECT_EQ(slot_.read().contacts.count, 1U);
  EXPECT_EQ(first().id, 2);

  for (const std::size_t at : {0U, 1U, 4U, 18U, 22U}) {
    now_ += 2000 * kStreamMillisecond;
    std::vector<double> bad = floorAt(0);
    bad[at] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(send(bad).text.code, RefusalCode::streamInvalid) << at;
    EXPECT_EQ(slot_.read().contacts.count, 0U);
  }
  now_ += 2000 * kStreamMillisecond;
  EXPECT_FALSE(send({1, 2, 3}).taken);
  EXPECT_FALSE(hold({std::numeric_limits<double>::infinity(), 0, 0}).taken);
  std::vector<double> twice = floorAt(0);
  twice.insert(twice.end(), twice.begin(), twice.begin() + 24);
  now_ += 2000 * kStreamMillisecond;
  EXPECT_THAT(send(twice).text.text, HasSubstr("give each its own"));
  EXPECT_EQ(slot_.read().contacts.count, 1U);
  EXPECT_TRUE(send(twice).text.text.empty()) << "one text per second";
}

TEST_F(StreamedInputTest, OneClientStreamsUntilItsLastValueExpires) {
  EXPECT_TRUE(send(floorAt(0), 1).taken);
  EXPECT_EQ(send(floorAt(0), 2).text.code, RefusalCode::streamedByOther);
  EXPECT_TRUE(hold({1, 0, 0}, 2).taken) << "forces are another stream";
  now_ += 100 * kStreamMillisecond;
  EXPECT_TRUE(send(floorAt(0), 2).taken);
  streamed_.clientGone(2);
  EXPECT_EQ(slot_.read().contacts.count, 0U);
  EXPECT_EQ(slot_.read().force.lifetime, 0);
  EXPECT_TRUE(send(floorAt(0), 1).taken);
}

TEST_F(StreamedInputTest, StampsBeyondAnyClockCountAsNone) {
  EXPECT_TRUE(send(floorAt(0), 1, std::numeric_limits<std::int64_t>::min()).taken);
  EXPECT_TRUE(send(floorAt(0), 1, std::numeric_limits<std::int64_t>::max()).taken);
  EXPECT_TRUE(send(floorAt(0), 1, 0, std::numeric_limits<std::int64_t>::max()).taken);
  EXPECT_EQ(slot_.read().contacts.clientTime, 0);
  EXPECT_EQ(slot_.read().contacts.stated, now_);
}

// The newest wins: a datagram that was overtaken changes nothing. Jitter of the way is not motion of the
// surface.
TEST_F(StreamedInputTest, OrdersByTheStampsOfTheClient) {
  constexpr std::int64_t kFar = 77'000 * kStreamMillisecond;
  send(floorAt(0.01), 1, kFar);
  now_ += 20 * kStreamMillisecond;
  send(floorAt(0.02), 1, kFar + 20 * kStreamMillisecond);
  EXPECT_FALSE(send(floorAt(0.03), 1, kFar + 10 * kStreamMillisecond).taken);
  EXPECT_NEAR(first().point_m.y(), 0.02, 1e-12);
  now_ += 27 * kStreamMillisecond;
  send(floorAt(0.02), 1, kFar + 40 * kStreamMillisecond);
  EXPECT_EQ(slot_.read().contacts.received, now_);
  EXPECT_NEAR(base::toSeconds(now_ - slot_.read().contacts.stated), 0.007, 0.0003) << "it was 7 ms late";
}

TEST_F(StreamedInputTest, ASimulationThatStartsAgainMaySetItsClockBack) {
  constexpr std::int64_t kFar = 77'000 * kStreamMillisecond;
  send(floorAt(0.01), 1, kFar);
  EXPECT_FALSE(send(floorAt(0.02), 1, kStreamMillisecond).taken);
  now_ += 500 * kStreamMillisecond;
  EXPECT_TRUE(send(floorAt(0.03), 1, kStreamMillisecond).taken) << "the last value has expired";
  EXPECT_NEAR(first().point_m.y(), 0.03, 1e-12);
  EXPECT_EQ(slot_.read().contacts.stated, now_);
}

}  // namespace
}  // namespace hapticd::server

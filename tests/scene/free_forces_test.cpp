// Effects, planes, fields, constraints, the buzz, and who owns them.
#include <gmock/gmock.h>

#include <malloc.h>

#include "scene_fixture.h"

namespace hapticd::scene {
namespace {

using geometry::Mat3;
using ::testing::HasSubstr;
using Severity = Notice::Severity;

class Forces : public SceneTest {
 protected:
  static constexpr ClientId kOther = 8;
  static DefineEffect constant(std::int32_t index, double duration_ms = 0) {
    return {.type = "constant",
            .index = index,
            .magnitude_N = 1.5,
            .duration_ms = duration_ms,
            .direction = Vec3(0, 2, 0)};
  }
  using SceneTest::SceneTest;
};

// Each of 50,000 numbers, of which no more than 64 exist at a time.
TEST_F(Forces, EffectsThatAreGoneKeepNoMemory) {
  const auto held = [] { return mallinfo2().uordblks; };  // 0 under sanitizers
  const auto define = [this](std::int32_t first) {
    for (std::int32_t i = first; i < first + 64; ++i) say(constant(i));
    say(ResetScene{});
  };
  define(0);
  const std::size_t before = held();
  for (std::int32_t first = 64; first < 50'000; first += 64) define(first);
  EXPECT_TRUE(notices_.empty());
  EXPECT_LT(held(), before + (std::size_t{1} << 20));
}

TEST_F(Forces, EffectsAreInSiAndKeepOnlyWhatTheirTypeUses) {
  const double nan = std::nan("");
  const Vec3 nowhere = Vec3::Constant(nan);
  say(DefineEffect{"constant", 0, nan, 1, 250, nan, nowhere, Vec3(0, 2, 0)});
  say(DefineEffect{"spring", 1, 0.5, 2, 0, nan, Vec3(1, 2, 3), nowhere});
  say(DefineEffect{"viscous", 2, 0.001, 2, 0, nan, nowhere, nowhere});
  say(DefineEffect{"friction", 3, 0.25, 0.7, 0, nan, nowhere, nowhere});
  say(DefineEffect{"vibrationMotor", 4, nan, 0.3, 0, 100, nowhere, nowhere});
  say(DefineEffect{"vibrationContact", 5, nan, 0.4, 0, 100, nowhere, nowhere});
  say(DefineEffect{"motorVibration", 6, nan, 0.3, 0, 50, nowhere, nowhere});
  say(DefineEffect{"contactVibration", 7, nan, 0.4, 0, 50, nowhere, nowhere});
  EXPECT_FALSE(publish() && !scene_->effects.empty()) << "defined is not started";
  for (int i = 7; i >= 0; --i) say(StartEffect{i});
  ASSERT_TRUE(publish());
  EXPECT_TRUE(notices_.empty());
  const auto& e = scene_->effects;
  ASSERT_EQ(e.size(), 8U);
  for (std::int32_t i = 0; i < 8; ++i) EXPECT_EQ(e[static_cast<std::size_t>(i)].index, i);
  EXPECT_EQ(e[0].type, EffectType::constant);
  EXPECT_EQ(e[0].duration, 250 * kMillisecond);
  EXPECT_EQ(e[0].direction, Vec3(0, 2, 0));
  EXPECT_EQ(e[0].position, Vec3::Zero());
  EXPECT_DOUBLE_EQ(e[1].gain, 500);
  EXPECT_EQ(e[1].position, Vec3(1, 2, 3));
  EXPECT_DOUBLE_EQ(e[2].gain, 1);
  EXPECT_DOUBLE_EQ(e[3].gain, 250);
  EXPECT_DOUBLE_EQ(e[3].magnitude_N, 0.7);
  EXPECT_EQ(e[4].type, EffectType::motorVibration);
  EXPECT_DOUBLE_EQ(e[4].angularFrequency_rad_per_s, 200 * EIGEN_PI);
  EXPECT_EQ(e[5].type, EffectType::contactVibration);
  EXPECT_DOUBLE_EQ(e[5].angularFrequency_rad_per_s, 100) << "rad/s as published";
  EXPECT_EQ(e[6].type, EffectType::motorVibration);
  EXPECT_EQ(e[7].type, EffectType::contactVibration);
}

TEST_F(Forces, RedefiningARunningEffectUpdatesItInPlace) {
  say(constant(3));
  say(StartEffect{3});
  publish();
  const std::uint32_t start = scene_->effects[0].start;
  auto changed = constant(3);
  changed.magnitude_N = 0.5;
  say(changed);
  publish();
  ASSERT_EQ(scene_->effects.size(), 1U);
  EXPECT_EQ(scene_->effects[0].start, start);
  EXPECT_DOUBLE_EQ(scene_->effects[0].magnitude_N, 0.5);
  say(StartEffect{3});
  publish();
  EXPECT_NE(scene_->effects[0].start, start) << "restart resets clock and phase";
}

TEST_F(Forces, TimedEffectsLeaveAfterTheirTimeAndCanBeStoppedBefore) {
  say(constant(1, 100));
  say(constant(2, 100));
  say(StartEffect{1});
  say(StartEffect{2});
  publish();
  wait(50 * kMillisecond);
  say(StopEffect{2});
  publish();
  ASSERT_EQ(scene_->effects.size(), 1U);
  EXPECT_EQ(scene_->effects[0].index, 1);
  run(60 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), 1U) << "the servo ends it by its own clock, not the scene";
  run(100 * kMillisecond);
  EXPECT_TRUE(scene_->effects.empty());
  say(StartEffect{1});
  publish();
  EXPECT_EQ(scene_->effects.size(), 1U) << "still defined";
  say(StopEffect{9});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("stopEffect 9"));
}

// Its entry waits for the clock of the servo: no force may return that nobody has started.
TEST_F(Forces, AnEffectThatHasEndedStaysEndedWhenItIsDefinedAnew) {
  for (const double duration_ms : {0.0, 500.0}) {
    say(constant(1, 100));
    say(StartEffect{1});
    publish();
    wait(110 * kMillisecond);
    say(constant(1, duration_ms));
    publish();
    EXPECT_TRUE(scene_->effects.empty()) << duration_ms;
    say(StartEffect{1});
    publish();
    EXPECT_EQ(scene_->effects.size(), 1U);
    say(StopEffect{1});
    run(100 * kMillisecond);
  }
}

TEST_F(Forces, ARunningEffectGoesOnWithAnotherDuration) {
  say(constant(1, 100));
  say(StartEffect{1});
  publish();
  wait(90 * kMillisecond);
  say(constant(1, 300));
  run(200 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), 1U);
  run(100 * kMillisecond);
  EXPECT_TRUE(scene_->effects.empty());
}

// A recording that begins while the server runs dates the publication of its scene before the description.
TEST_F(Forces, OneThatGoesOnInARecordingEndsWhenItDid) {
  say(constant(1, 300));
  say(ContinueEffect{1, 100 * kMillisecond});
  now_ -= 200 * kMillisecond;
  publish();
  now_ += 200 * kMillisecond;
  run(240 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), 1U);
  run(20 * kMillisecond);
  EXPECT_TRUE(scene_->effects.empty());
}

// A publication takes as long as its meshes: the servo is given all of it when it is over.
class ForcesOfLongPublications : public Forces {
 protected:
  ForcesOfLongPublications() : Forces(config()) {}

  static SceneConfig config() {
    SceneConfig config;
    config.stopwatch = [] { return end_; };
    return config;
  }
  void publishFor(Nanos time) {
    end_ = now_ + time;
    publish();
    now_ = end_;
  }

  inline static Nanos end_ = 0;
};

TEST_F(ForcesOfLongPublications, TimedForcesLastFromTheEndOfTheirPublication) {
  say(constant(1, 20));
  say(StartEffect{1});
  say(StartCustomEffect{0, {1, 40, 0.02, 0, 0, 1}});
  publishFor(400 * kMillisecond);
  run(60 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), 1U);
  EXPECT_TRUE(scene_->buzz);
  run(20 * kMillisecond);
  EXPECT_TRUE(scene_->effects.empty());
  EXPECT_FALSE(scene_->buzz);
}

TEST_F(ForcesOfLongPublications, AStartThatIsLateWaitsForItsPublication) {
  say(constant(1, 20));
  say(StartEffect{1});
  wait(300 * kMillisecond);  // the thread applies much else before it publishes
  say(constant(1, 20));
  publish();
  EXPECT_EQ(scene_->effects.size(), 1U);
}

TEST_F(ForcesOfLongPublications, AnotherDurationCountsFromThere) {
  say(constant(1, 100));
  say(StartEffect{1});
  publishFor(400 * kMillisecond);
  wait(90 * kMillisecond);
  say(constant(1, 200));
  run(130 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), 1U) << "it runs for 220 ms";
  run(40 * kMillisecond);
  EXPECT_TRUE(scene_->effects.empty());
}

TEST_F(ForcesOfLongPublications, WhatRampsOutDoesFromThere) {
  say(constant(1));
  say(StartEffect{1});
  say(SetPlane{.index = 0, .plane = {0, 1, 0, 0}, .stiffness = 0.5});
  say(SetForceField{.force_N = Vec3(0, 1, 0), .radius_m = 1});
  say(SetConstraintEnabled{true});
  say(SetConstraintMode{1});
  publish();
  say(ResetScene{});
  publishFor(400 * kMillisecond);
  run(250 * kMillisecond);
  ASSERT_EQ(scene_->effects.size(), 1U);
  EXPECT_TRUE(scene_->effects[0].releasing);
  EXPECT_EQ(scene_->planes.size(), 1U);
  EXPECT_EQ(scene_->fields.size(), 2U);
  run(60 * kMillisecond);
  EXPECT_TRUE(scene_->effects.empty());
  EXPECT_TRUE(scene_->planes.empty());
  EXPECT_TRUE(scene_->fields.empty());
}

// Else it would begin with the next command of anybody, whenever that comes.
TEST(ForcesOfFailedPublications, AreNotFeltLater) {
  bool isFull = false;
  SceneConfig config;
  config.stopwatch = [&]() -> Nanos {
    if (isFull) throw std::bad_alloc();
    return 0;
  };
  SceneBuilder builder(config);
  std::vector<Notice> notices;
  Nanos now = kMillisecond;
  builder.publish(now, notices);
  builder.apply(7, SetObjectNumber{1}, now, notices);
  builder.apply(7, SetVertices{0, 0, oneTriangle()}, now, notices);
  builder.apply(7, DefineEffect{.type = "constant", .index = 1, .magnitude_N = 1, .duration_ms = 20}, now,
                notices);
  builder.apply(7, StartEffect{1}, now, notices);
  isFull = true;
  now += kMillisecond;
  EXPECT_THROW(builder.publish(now, notices), std::bad_alloc);
  isFull = false;
  now += 1000 * kMillisecond;
  builder.apply(7, SetTouchableFaces{}, now, notices);
  const auto scene = builder.publish(now, notices);
  ASSERT_TRUE(scene);
  EXPECT_TRUE(scene->effects.empty());
}

// 0 lasts until the effect is stopped: neither less nor almost nothing may become it unnoticed.
TEST_F(Forces, DurationsBelowZeroAreToldAndShortOnesEnd) {
  say(constant(1, -5));
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("setEffect 1, duration -5: negative, 0 is used"));
  say(constant(2, 1e-7));
  say(StartEffect{1});
  say(StartEffect{2});
  publish();
  ASSERT_EQ(scene_->effects.size(), 2U);
  EXPECT_EQ(scene_->effects[0].duration, 0);
  EXPECT_EQ(scene_->effects[1].duration, 1);
  run(100 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), 1U);
  EXPECT_TRUE(notices_.empty());
}

// Samples of a vibration above half the servo's rate are those of a slower one, or of a constant force.
TEST_F(Forces, VibrationsThatTheServoCannotRenderAreLowered) {
  say(DefineEffect{.type = "vibrationMotor", .index = 1, .magnitude_N = 1, .frequency = 1000});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("frequency 1000 to 450"));
  say(DefineEffect{.type = "vibrationContact", .index = 2, .magnitude_N = 1, .frequency = 6283});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("frequency 6283 to 2827.43"));
  say(StartEffect{1});
  say(StartEffect{2});
  say(StartCustomEffect{0, {1, 2000}});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("frequency 2000 to 450"));
  say(SetPlane{.index = 0, .plane = {0, 1, 0, 0}, .stiffness = 0.5});
  say(SetPlaneDetail{.buzzAmplitude_m = 0.001, .buzzFrequency_Hz = 451});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("frequency 451 to 450"));
  publish();
  const double highest = 900 * EIGEN_PI;
  EXPECT_DOUBLE_EQ(scene_->effects.at(0).angularFrequency_rad_per_s, highest);
  EXPECT_DOUBLE_EQ(scene_->effects.at(1).angularFrequency_rad_per_s, highest);
  EXPECT_DOUBLE_EQ(scene_->buzz->angularFrequency_rad_per_s, highest);
  EXPECT_DOUBLE_EQ(scene_->planes.at(0).buzzAngularFrequency_rad_per_s, highest);
}

TEST_F(Forces, StartMayComeBeforeItsDefinition) {
  say(StartEffect{4});
  wait(999 * kMillisecond);
  publish();
  say(constant(4));
  publish();
  EXPECT_EQ(scene_->effects.size(), 1U);
  EXPECT_TRUE(notices_.empty());
  say(StartEffect{5});
  run(1'000 * kMillisecond);
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("startEffect 5"));
  say(constant(5));
  publish();
  EXPECT_EQ(scene_->effects.size(), 1U);
  say(StartEffect{6});
  say(StopEffect{6});
  say(constant(6));
  publish();
  EXPECT_EQ(scene_->effects.size(), 1U) << "stopped before it came";
  run(3'000 * kMillisecond);
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Forces, StartsThatWaitAreAsManyAsEffects) {
  const auto most = static_cast<std::int32_t>(SceneConfig{}.limits.effects);
  for (std::int32_t i = 0; i < most; ++i) say(StartEffect{i});
  say(StartEffect{0});  // it waits already
  EXPECT_TRUE(notices_.empty());
  say(StartEffect{most}, kOther);
  EXPECT_EQ(notices_.at(0).client, kOther);
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("startEffect " + std::to_string(most) + ": refused"));
  say(constant(0));
  publish();
  EXPECT_EQ(scene_->effects.size(), 1U) << "one of those that wait";
  run(1'000 * kMillisecond);
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("startEffect "));
}

// Each may have all of the bound, and all together no more.
TEST_F(Forces, EffectsTogetherStayWithinTheBound) {
  const auto load = [this] {
    double stiffness_N_per_m = 0;
    double damping_Ns_per_m = 0;
    for (const Effect& e : scene_->effects) {
      if (!e.releasing) (e.type == EffectType::viscous ? damping_Ns_per_m : stiffness_N_per_m) += e.gain;
    }
    for (const ForceField& f : scene_->fields) {
      if (!f.releasing) stiffness_N_per_m += 1000 * f.jacobian_N_per_unit.cwiseAbs().maxCoeff();
    }
    return 0.5e-3 * stiffness_N_per_m + damping_Ns_per_m;
  };
  say(DefineEffect{.type = "spring", .index = 1, .gain = 9, .magnitude_N = 1});
  say(StartEffect{1});
  ASSERT_TRUE(publish());
  EXPECT_TRUE(notices_.empty());
  EXPECT_DOUBLE_EQ(scene_->effects[0].gain, 9000);
  say(DefineEffect{.type = "viscous", .index = 2, .gain = 0.004, .magnitude_N = 1});
  say(StartEffect{2});
  ASSERT_TRUE(publish());
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("all effects together"));
  EXPECT_NEAR(load(), 4.995, 1e-9);
  EXPECT_NEAR(scene_->effects[0].gain / scene_->effects[1].gain, 9000 / 4.0, 1e-6)
      << "as they were asked for";
  say(SetForceField{.jacobian_N_per_m = {-5000, 0, 0, 0, -5000, 0, 0, 0, -5000}, .radius_m = 1});
  ASSERT_TRUE(publish());
  EXPECT_NEAR(load(), 4.995, 1e-9);
  say(StopEffect{1});
  say(SetForceField{});
  ASSERT_TRUE(publish());
  EXPECT_NEAR(scene_->effects[0].gain, 4, 1e-12) << "alone again";
  say(DefineEffect{.type = "spring", .index = 3, .gain = 9, .magnitude_N = 1}, kOther);
  say(StartEffect{3}, kOther);
  notices_.clear();
  builder_.clientGone(kOther, now_);
  ASSERT_TRUE(publish());
  EXPECT_NEAR(scene_->effects[0].gain, 4, 1e-12) << "what ramps out does not count";
}

// A hand that touches feels both: each surface beside all effects and fields.
TEST_F(Forces, SurfacesEffectsAndFieldsTogetherStayWithinTheBound) {
  constexpr double kBound_Ns_per_m = 4.995;
  const auto free = [this] {
    double load = 0;
    for (const Effect& e : scene_->effects) load += e.type == EffectType::viscous ? e.gain : 0.5e-3 * e.gain;
    for (const ForceField& f : scene_->fields) load += 0.5 * f.jacobian_N_per_unit.cwiseAbs().maxCoeff();
    return load;
  };
  const auto loadOf = [](const Surface& s) { return 0.5e-3 * s.stiffness_N_per_m + s.damping_Ns_per_m; };
  say(SetObjectNumber{3}, kOther);
  for (std::int32_t i = 0; i < 3; ++i) {
    say(SetVertices{i, 0, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}, kOther);
    say(SetSurface{i, i == 2 ? 0.1F : 1.0F, i == 1 ? 0.003F : 0.0F}, kOther);
  }
  say(SetPlane{.plane = {0, 0, 1, 0}, .stiffness = 1, .damping = 0.004F});
  run(1'000 * kMillisecond);
  ASSERT_EQ(scene_->objects.size(), 3U);
  notices_.clear();
  const auto alone = [this] {
    return std::array{scene_->objects[0]->surface, scene_->objects[1]->surface, scene_->objects[2]->surface,
                      scene_->planes[0].surface};
  };
  const auto asked = alone();
  say(DefineEffect{.type = "spring", .index = 1, .gain = 2, .magnitude_N = 1});
  say(StartEffect{1});
  ASSERT_TRUE(publish());
  EXPECT_NEAR(scene_->effects[0].gain, 2000 * kBound_Ns_per_m / (1 + 4.5), 1e-3) << "beside the plane";
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(alone()[i], asked[i]) << i << " has room beside it";
  EXPECT_NEAR(loadOf(alone()[3]), 4.5 * kBound_Ns_per_m / 5.5, 1e-6);
  EXPECT_LE(loadOf(alone()[3]) + free(), kBound_Ns_per_m * (1 + 1e-12));

  notices_.clear();
  say(SetForceField{.jacobian_N_per_m = {-4000, 0, 0, 0, -4000, 0, 0, 0, -4000}, .radius_m = 1});
  ASSERT_TRUE(publish());
  for (const Surface& surface : alone()) EXPECT_LE(loadOf(surface) + free(), kBound_Ns_per_m * (1 + 1e-12));
  EXPECT_NEAR(loadOf(alone()[1]), 3.5 * kBound_Ns_per_m / (3 + 3.5), 1e-6);
  EXPECT_NEAR(alone()[1].stiffness_N_per_m / alone()[1].damping_Ns_per_m, 1000 / 3.0, 1e-3)
      << "both by one factor";
  EXPECT_EQ(alone()[0], asked[0]) << "0.5 beside 3";
  EXPECT_EQ(alone()[2], asked[2]);
  std::vector<ClientId> told;
  std::string texts;
  for (const Notice& notice : notices_) {
    told.push_back(notice.client);
    texts += notice.text + "\n";
  }
  EXPECT_THAT(told, ::testing::UnorderedElementsAre(7, 7, kOther)) << texts;
  for (const char* text : {"sendForceField", "sendSurface plane 0 to 67 %", "surface of object 1 to 77 %"})
    EXPECT_THAT(texts, HasSubstr(text));

  say(StopEffect{1});
  say(SetForceField{});
  ASSERT_TRUE(publish());
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(alone()[i], asked[i]) << i << " as before";
}

// Whoever sets what is lowered learns so, whichever of them came first.
TEST_F(Forces, ClientsLearnThatWhatTheySetIsLoweredBesidePlanesAndFields) {
  const auto texts = [this](ClientId client) {
    std::string all;
    for (const Notice& notice : notices_) {
      if (notice.client == client) all += notice.text + "\n";
    }
    return all;
  };
  const auto startSpring = [this] {
    say(DefineEffect{.type = "spring", .index = 1, .gain = 9, .magnitude_N = 1});
    say(StartEffect{1});
  };
  const SetPlane plane{.plane = {0, 0, 1, 0}, .stiffness = 1, .damping = 0.004F};
  const SetForceField field{.jacobian_N_per_m = {-2000, 0, 0, 0, -2000, 0, 0, 0, -2000}, .radius_m = 1};

  say(plane, kOther);
  ASSERT_TRUE(publish());
  EXPECT_TRUE(notices_.empty());
  startSpring();
  ASSERT_TRUE(publish());
  EXPECT_THAT(texts(7), HasSubstr("startEffect to 55 %"));
  EXPECT_THAT(texts(kOther), HasSubstr("sendSurface plane 0 to 55 %"));
  notices_.clear();
  say(plane, kOther);
  ASSERT_TRUE(publish());
  EXPECT_TRUE(notices_.empty()) << "once for each share: stock clients send their planes all the time";

  say(StopEffect{1});
  say(SetPlane{}, kOther);
  say(field, kOther);
  ASSERT_TRUE(publish());
  EXPECT_TRUE(notices_.empty());
  startSpring();
  ASSERT_TRUE(publish());
  EXPECT_THAT(texts(7), HasSubstr("startEffect to 91 %"));
  EXPECT_THAT(texts(kOther), HasSubstr("sendForceField"));
}

// A client that sets all at once learns it, too, in whatever order.
TEST_F(Forces, ClientsLearnThatTheirEffectsAreLoweredBesideWhatComesWithThem) {
  const auto percentOf = [this](const std::vector<SceneCommand>& commands) {
    for (const SceneCommand& command : commands) say(command);
    run(100 * kMillisecond);
    std::string percent;
    for (const Notice& notice : notices_) {
      if (notice.text.rfind("startEffect to ", 0) == 0) percent += notice.text.substr(15, 5);
    }
    say(ResetScene{});
    run(1'000 * kMillisecond);
    notices_.clear();
    return percent;
  };
  const DefineEffect spring{.type = "spring", .index = 1, .gain = 9, .magnitude_N = 1};
  const SetPlane plane{.plane = {0, 0, 1, 0}, .stiffness = 1, .damping = 0.004F};
  EXPECT_EQ(percentOf({spring, StartEffect{1}}), "");
  EXPECT_EQ(percentOf({spring, StartEffect{1}, plane}), "55 %:");
  EXPECT_EQ(percentOf({plane, spring, StartEffect{1}}), "55 %:");
  EXPECT_EQ(percentOf({plane, spring, StartEffect{1}, StopEffect{1}}), "");
  const std::vector<SceneCommand> mesh{SetVertices{0, 0, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
                                       SetSurface{0, 1.0F, 0.004F}};
  EXPECT_EQ(percentOf({mesh[0], mesh[1], spring, StartEffect{1}}), "55 %:");
  EXPECT_EQ(percentOf({SetHapticScale{10}, SetConstraintMode{1}, SetConstraintStiffness{900},
                       SetConstraintEnabled{true}, spring, StartEffect{1}}),
            "56 %:");
}

// Its slope there is a stiffness as any other.
TEST_F(Forces, RimOfAFieldIsNoStifferThanTheBound) {
  constexpr double kBound_N_per_m = 9990;
  for (const double radius_mm : {0.2, 2.0, 20.0}) {
    for (const double force_N : {1.0, 3.0, 40.0}) {
      say(SetForceField{.force_N = Vec3(0, 0, force_N), .radius_m = 1e-3 * radius_mm});
      ASSERT_TRUE(publish());
      const ForceField& field = scene_->fields[0];
      const double most_N = std::min(10.0, field.force_N.norm());
      EXPECT_LE(most_N / (field.rim * field.radius * 1e-3), kBound_N_per_m * (1 + 1e-9));
      const double narrow = most_N / (0.1e-3 * radius_mm);
      if (narrow < kBound_N_per_m) {
        EXPECT_EQ(field.rim, 0.1);
        EXPECT_EQ(field.force_N.z(), force_N);
      }
      EXPECT_LE(field.rim, 1);
    }
  }
  EXPECT_EQ(scene_->fields[0].radius, 20) << "world units";
}

// By which call, from what to what; once for each field and share. The surface of an empty object is none.
TEST_F(Forces, OwnersOfLoweredFieldsAreTold) {
  const SetForceField stiff{.jacobian_N_per_m = {-20'000, 0, 0, 0, -20'000, 0, 0, 0, 0}, .radius_m = 1};
  say(stiff);
  publish();
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("sendForceField, stiffness 20000 to 9990 N/m"));
  say(constant(0));
  say(StartEffect{0});
  publish();
  EXPECT_TRUE(notices_.empty()) << "the same field";
  say(SetForceField{.force_N = Vec3(0, 0, 4), .radius_m = 0.2e-3});
  publish();
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("sendForceField, force 4 to 1.998 N"));
  say(SetForceField{.force_N = Vec3(0, 0, 4), .radius_m = 0.2});
  publish();
  EXPECT_TRUE(notices_.empty()) << "within the bound";
  say(SetForceField{});
  say(SetConstraintStiffness{6000}, kOther);
  say(SetConstraintMode{1}, kOther);
  say(SetConstraintEnabled{true}, kOther);
  publish();
  EXPECT_TRUE(notices_.empty());
  say(DefineEffect{.type = "spring", .index = 1, .gain = 9, .magnitude_N = 1});
  say(StartEffect{1});
  publish();
  ASSERT_EQ(notices_.size(), 2U);
  EXPECT_EQ(notices_[0].client, 7U);
  EXPECT_THAT(notices_[0].text, HasSubstr("startEffect to 67 %"));
  EXPECT_EQ(notices_[1].client, kOther);
  EXPECT_THAT(notices_[1].text, HasSubstr("constraint_KSpring, stiffness 6000 to 3996 N/m"));
}

TEST_F(Forces, NegativeAndUnstableParametersAreLowered) {
  say(DefineEffect{.type = "spring", .index = 1, .gain = -1, .magnitude_N = 1});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("gain -1"));
  say(DefineEffect{.type = "spring", .index = 1, .gain = 50, .magnitude_N = 1});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("unstable"));
  say(DefineEffect{.type = "viscous", .index = 2, .gain = 0.1, .magnitude_N = 1});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("unstable"));
  say(DefineEffect{.type = "constant", .index = 3, .magnitude_N = 1, .duration_ms = -5});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("direction is zero"));
  say(StartEffect{1});
  publish();
  EXPECT_NEAR(scene_->effects[0].gain, 10'000, 20) << "5 N s/m / 0.5 ms";
  say(StopEffect{1});
  for (const int i : {2, 3}) say(StartEffect{i});
  publish();
  EXPECT_NEAR(scene_->effects[0].gain, 5, 0.01);
  EXPECT_EQ(scene_->effects[1].duration, 0);
}

TEST_F(Forces, AtMostAsManyEffectsAsTheLimit) {
  for (int i = 0; i < 64; ++i) say(constant(i));
  EXPECT_TRUE(notices_.empty());
  say(constant(64));
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("at most 64"));
  say(constant(63));
  EXPECT_TRUE(notices_.empty());
}

// However many of one reset: each keeps its ramp while another has its index.
TEST_F(Forces, EachEffectThatIsReplacedWhileItRampsOutKeepsItsRamp) {
  const auto startAll = [&] {
    for (int i = 0; i < 64; ++i) {
      say(constant(i));
      say(StartEffect{i});
    }
  };
  const auto releasing = [&](const Effect& e) { return e.releasing; };
  startAll();
  publish();
  say(ResetScene{});
  startAll();
  ASSERT_TRUE(publish());
  EXPECT_EQ(std::ranges::count_if(scene_->effects, releasing), 64);
  run(400 * kMillisecond);
  EXPECT_EQ(std::ranges::count_if(scene_->effects, releasing), 0);
  EXPECT_EQ(scene_->effects.size(), 64U);
}

// A client that resets the scene and starts its effects anew, whatever their numbers.
TEST_F(Forces, WhatRampsOutTakesNoPlaceOfTheLimit) {
  constexpr std::size_t kMost = kMaxEffects;
  const auto startAll = [&](int first) {
    for (int i = first; i < first + 64; ++i) {
      say(constant(i));
      say(StartEffect{i});
    }
  };
  const auto releasing = [&] {
    return static_cast<std::size_t>(
        std::ranges::count_if(scene_->effects, [](const Effect& e) { return e.releasing; }));
  };
  startAll(0);
  publish();
  for (const int first : {100, 100, 200}) {  // the same indices, too
    say(ResetScene{});
    startAll(first);
    ASSERT_TRUE(publish());
    EXPECT_TRUE(notices_.empty()) << notices_.front().text;
    EXPECT_EQ(scene_->effects.size() - releasing(), kMost);
    EXPECT_GE(releasing(), kMost);
    EXPECT_LE(releasing(), kMost + kMostOfEarlierReset) << "the oldest end";
    for (const Effect& e : scene_->effects) EXPECT_TRUE(e.releasing || e.index >= first) << e.index;
    wait(10 * kMillisecond);
  }
  say(constant(300));
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("at most 64"));
  run(400 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), kMost);
}

TEST_F(Forces, ReleasedForcesRampOutAndAnOpenBatchStays) {
  say(SetPlane{.index = 1, .plane = {0, 1, 0, 0}, .stiffness = 0.5});
  say(BeginBatch{});
  say(SetPlane{.index = 0, .plane = {0, 1, 0, 0.01}, .stiffness = 0.5});
  say(ReleaseForces{});
  ASSERT_TRUE(publish());
  ASSERT_EQ(scene_->planes.size(), 1U);
  EXPECT_TRUE(scene_->planes[0].releasing);
  say(CommitBatch{});
  ASSERT_TRUE(publish());
  ASSERT_EQ(scene_->planes.size(), 2U);
  EXPECT_FALSE(scene_->planes[0].releasing) << "set after the release";
}

TEST_F(Forces, WhatAClientOwnsRampsOutWhenItLeaves) {
  say(constant(1));
  say(StartEffect{1});
  say(constant(2));
  say(StartEffect{2}, kOther);  // taken over by starting it
  say(SetPlane{.index = 1, .plane = {0, 1, 0, 0}, .stiffness = 0.5});
  say(SetForceField{.force_N = Vec3(1, 0, 0), .radius_m = 1});
  say(SetConstraintMode{1}, kOther);
  say(SetConstraintEnabled{true}, kOther);
  say(StartCustomEffect{0, {}});
  makeTouchable(0);
  builder_.clientGone(kClient, now_);
  ASSERT_TRUE(publish());
  ASSERT_EQ(scene_->effects.size(), 2U);
  EXPECT_TRUE(scene_->effects[0].releasing);
  EXPECT_FALSE(scene_->effects[1].releasing);
  EXPECT_TRUE(scene_->planes.at(0).releasing);
  ASSERT_EQ(scene_->fields.size(), 2U);
  EXPECT_TRUE(scene_->fields[0].releasing);
  EXPECT_FALSE(scene_->fields[1].releasing);
  EXPECT_TRUE(scene_->buzz->releasing);
  wait(250 * kMillisecond);
  publish();
  EXPECT_EQ(scene_->effects.size(), 2U) << "not before it has ramped out";
  run(100 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), 1U);
  EXPECT_TRUE(scene_->planes.empty());
  EXPECT_EQ(scene_->fields.size(), 1U);
  EXPECT_FALSE(scene_->buzz);
  EXPECT_NE(object(0), nullptr) << "objects belong to the scene";
  say(StartEffect{1}, kOther);
  run(1'000 * kMillisecond);
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("startEffect 1")) << "definitions go with their owner";
}

TEST_F(Forces, ResetRampsAllOutWhoeverOwnsIt) {
  say(constant(1));
  say(StartEffect{1}, kOther);
  say(SetForceField{.force_N = Vec3(1, 0, 0), .radius_m = 1}, kOther);
  publish();
  const std::uint32_t start = scene_->effects[0].start;
  say(ResetScene{});
  publish();
  EXPECT_TRUE(scene_->effects.at(0).releasing);
  EXPECT_TRUE(scene_->fields.at(0).releasing);
  // The same index may be used again at once.
  say(constant(1));
  say(StartEffect{1});
  publish();
  EXPECT_FALSE(scene_->effects.at(0).releasing);
  EXPECT_NE(scene_->effects[0].start, start);
  run(1'000 * kMillisecond);
  EXPECT_EQ(scene_->effects.size(), 1U);
  EXPECT_TRUE(scene_->fields.empty());
}

// A client that comes while the forces of another ramp out gets none of them, and ends none at once.
TEST_F(Forces, WhatIsSetWhileAnotherRampsOutIsItsOwn) {
  say(SetConstraintMode{2});
  say(SetConstraintStiffness{500});
  say(SetConstraintEnabled{true});
  say(SetForceField{.force_N = Vec3(1, 0, 0), .radius_m = 1});
  say(constant(0));
  say(StartEffect{0});
  say(SetPlane{.index = 3, .plane = {0, 1, 0, 0}, .stiffness = 0.5});
  publish();
  const std::uint32_t placement = scene_->planes.at(0).placement;
  builder_.clientGone(kClient, now_);
  wait(100 * kMillisecond);
  say(SetConstraintVector{ConstraintVector::linePoint, Vec3(0.001, 0, 0)}, kOther);
  say(SetForceField{.force_N = Vec3(0, 2, 0), .radius_m = 1}, kOther);
  say(constant(0), kOther);
  say(SetPlane{.index = 3, .plane = {0, 1, 0, 0}, .stiffness = 0.5}, kOther);
  ASSERT_TRUE(publish());
  ASSERT_EQ(scene_->effects.size(), 1U) << "defined, not started";
  EXPECT_TRUE(scene_->effects[0].releasing);
  ASSERT_EQ(scene_->fields.size(), 3U);
  for (const ForceField& field : scene_->fields) EXPECT_EQ(field.releasing, field.force_N.y() == 0);
  EXPECT_NE(scene_->fields[1].number, scene_->fields[2].number);
  EXPECT_FALSE(scene_->planes.at(0).releasing);
  EXPECT_NE(scene_->planes[0].placement, placement) << "the servo has to place it anew";
  run(300 * kMillisecond);
  EXPECT_TRUE(scene_->effects.empty());
  ASSERT_EQ(scene_->fields.size(), 1U);
  EXPECT_EQ(scene_->fields[0].force_N.y(), 2);
  EXPECT_EQ(scene_->planes.size(), 1U);
  say(SetConstraintEnabled{true}, kOther);
  publish();
  EXPECT_EQ(scene_->fields.size(), 1U) << "its mode is none";
  say(SetConstraintMode{2}, kOther);
  publish();
  ASSERT_EQ(scene_->fields.size(), 2U);
  EXPECT_EQ(scene_->fields[1].origin, Vec3(1, 0, 0)) << "what it set meanwhile";
}

TEST_F(Forces, PlanesAreInWorldUnitsWithStockSurfaces) {
  say(SetPlane{.index = 0,
               .plane = {0, 2, 0, 0.02},
               .stiffness = 0.8,
               .damping = 0.001,
               .staticFriction = 0.2,
               .dynamicFriction = 0.3,
               .recoveryCycles = 10});
  say(SetPlaneDetail{.textureAmplitude_m = 0.001,
                     .textureWavelength_m = 0.00001,
                     .buzzAmplitude_m = 0.002,
                     .buzzFrequency_Hz = 60});
  publish();
  ASSERT_EQ(scene_->planes.size(), 1U);
  const Plane p = scene_->planes[0];
  EXPECT_EQ(p.normal, Vec3::UnitY());
  EXPECT_DOUBLE_EQ(p.offset, 10);
  EXPECT_DOUBLE_EQ(p.surface.stiffness_N_per_m, 800);
  EXPECT_DOUBLE_EQ(p.surface.damping_Ns_per_m, 1);
  EXPECT_DOUBLE_EQ(p.surface.dynamicFriction, 0.2);
  EXPECT_EQ(p.recovery, 10 * kMillisecond);
  EXPECT_DOUBLE_EQ(p.textureAmplitude, 1);
  EXPECT_DOUBLE_EQ(p.textureWavelength, 0.06) << "the shortest";
  EXPECT_DOUBLE_EQ(p.buzzAmplitude, 2);
  EXPECT_DOUBLE_EQ(p.buzzAngularFrequency_rad_per_s, 120 * EIGEN_PI);
  say(SetPlane{.index = 0, .plane = {0, 2, 0, 0.02}, .stiffness = 0.5});
  publish();
  EXPECT_EQ(scene_->planes[0].placement, p.placement) << "another surface, the same place";
  EXPECT_EQ(scene_->planes[0].recovery, p.recovery) << "it rises as it began to";
  int copies = 0;
  for (const ClientCommand& c : builder_.commands(now_)) {
    if (const auto* const plane = std::get_if<SetPlane>(&c.command)) {
      ++copies;
      EXPECT_EQ(plane->recoveryCycles, 10) << "also in a recording that begins now";
    }
  }
  EXPECT_EQ(copies, 1);
  say(SetPlane{.index = 0, .plane = {0, 2, 0, 0.03}, .stiffness = 0.5});
  publish();
  EXPECT_NE(scene_->planes[0].placement, p.placement);
  say(SetPlane{.index = 0, .plane = {0, 0, 0, 0.03}});
  publish();
  EXPECT_TRUE(scene_->planes.empty()) << "a zero normal removes it";
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Forces, APlaneWhoseNormalIsNotANumberIsRefused) {
  const double nan = std::nan("");
  const SetPlane plane{.index = 0, .plane = {0, 2, 0, 0.02}, .stiffness = 0.8};
  say(plane);
  for (std::size_t i = 0; i < 4; ++i) {
    SetPlane broken = plane;
    broken.plane = {0, 0, 0, 0};
    broken.plane[i] = nan;
    if (i == 3) broken.plane[0] = 1;
    say(broken);
    EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("not finite")) << i;
  }
  publish();
  EXPECT_EQ(scene_->planes.size(), 1U) << "the one before stays";
}

TEST_F(Forces, TextureAndBuzzEndWithTheirClient) {
  const SetPlane plane{.index = 0, .plane = {0, 1, 0, 0}, .stiffness = 0.5};
  say(plane);
  say(SetPlaneDetail{.buzzAmplitude_m = 0.0005, .buzzFrequency_Hz = 40});
  builder_.clientGone(kClient, now_);
  publish();
  EXPECT_DOUBLE_EQ(scene_->planes.at(0).buzzAmplitude, 0.5) << "while the plane ramps out";
  say(plane, kOther);
  publish();
  EXPECT_EQ(scene_->planes.at(0).buzzAmplitude, 0);
  run(1'000 * kMillisecond);
  say(plane, kOther);
  publish();
  EXPECT_EQ(scene_->planes.at(0).buzzAmplitude, 0);
  say(SetPlaneDetail{.buzzAmplitude_m = 0.001, .buzzFrequency_Hz = 40}, kOther);
  publish();
  EXPECT_DOUBLE_EQ(scene_->planes.at(0).buzzAmplitude, 1);
}

TEST_F(Forces, WhoSendsATextureOfMoreThan10mmOfTheDeviceIsTold) {
  say(SetPlaneDetail{.textureAmplitude_m = 0.010, .textureWavelength_m = 0.1, .buzzAmplitude_m = 0.010});
  publish();
  EXPECT_TRUE(notices_.empty());
  say(SetPlaneDetail{.textureAmplitude_m = 0.5, .textureWavelength_m = 2});
  publish();
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("plane 0, 0.5 m to 0.01"));
  say(SetHapticScale{10});  // together with what follows
  say(SetPlaneDetail{.textureAmplitude_m = 0.09, .textureWavelength_m = 1});
  publish();
  EXPECT_TRUE(notices_.empty()) << "9 mm of the device";
  say(SetPlaneDetail{.buzzAmplitude_m = 0.2, .buzzFrequency_Hz = 10});
  publish();
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("plane 0, 0.2 m to 0.1"));
  say(SetHapticScale{0.1});
  say(SetPlaneDetail{.buzzAmplitude_m = 0.005, .buzzFrequency_Hz = 10});
  publish();
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("plane 0, 0.005 m to 0.001"));
}

TEST_F(Forces, FieldIsInWorldUnitsAndAllZeroStopsIt) {
  say(SetForceField{.origin_m = Vec3(0.01, 0, 0),
                    .force_N = Vec3(0, 1, 0),
                    .jacobian_N_per_m = {0, -100, 0, 0, 0, 0, 0, 0, 0},
                    .radius_m = 0.05});
  publish();
  ASSERT_EQ(scene_->fields.size(), 1U);
  EXPECT_EQ(scene_->fields[0].origin, Vec3(10, 0, 0));
  EXPECT_DOUBLE_EQ(scene_->fields[0].radius, 50);
  EXPECT_DOUBLE_EQ(scene_->fields[0].jacobian_N_per_unit(0, 1), -0.1) << "row by row";
  EXPECT_TRUE(notices_.empty());
  say(SetForceField{.force_N = Vec3(0, 1, 0), .radius_m = -0.05});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("there will be no force"));
  say(SetForceField{});
  publish();
  EXPECT_TRUE(scene_->fields.empty());
}

TEST_F(Forces, StiffFieldIsKeptPassiveInDeviceMetresWhateverTheWorkspace) {
  const double k = 8'000;
  say(SetForceField{.jacobian_N_per_m = {-k, 0, 0, 0, -k, 0, 0, 0, -k}, .radius_m = 1});
  publish();
  EXPECT_DOUBLE_EQ(scene_->fields[0].jacobian_N_per_unit(1, 1), -8);
  say(SetHapticScale{10});
  publish();
  EXPECT_NEAR(scene_->fields[0].jacobian_N_per_unit(1, 1) * scene_->workspace.worldUnitsPerMetre, -10'000,
              20);
}

TEST_F(Forces, ConstraintsAreTheSpringsThatStockClientsSend) {
  say(SetConstraintStiffness{100});
  say(SetConstraintVector{ConstraintVector::point, Vec3(0.001, 0, 0)});
  say(SetConstraintVector{ConstraintVector::linePoint, Vec3(0, 0.002, 0)});
  say(SetConstraintVector{ConstraintVector::lineDirection, Vec3(0, 0, 3)});
  say(SetConstraintVector{ConstraintVector::planePoint, Vec3(0, 0, 0.003)});
  say(SetConstraintVector{ConstraintVector::planeNormal, Vec3(-2, 0, 0)});
  say(SetConstraintMode{1});
  publish();
  EXPECT_TRUE(scene_->fields.empty()) << "not enabled";
  say(SetConstraintEnabled{true});
  publish();
  const Mat3 expected[] = {Mat3::Identity(), Vec3(1, 1, 0).asDiagonal(), Vec3(1, 0, 0).asDiagonal()};
  const Vec3 origins[] = {Vec3(1, 0, 0), Vec3(0, 2, 0), Vec3(0, 0, 3)};
  for (int mode = 1; mode <= 3; ++mode) {
    say(SetConstraintMode{mode});
    publish();
    ASSERT_EQ(scene_->fields.size(), 1U);
    EXPECT_TRUE(scene_->fields[0].jacobian_N_per_unit.isApprox(-0.1 * expected[mode - 1], 1e-12)) << mode;
    EXPECT_EQ(scene_->fields[0].origin, origins[mode - 1]);
    EXPECT_EQ(scene_->fields[0].radius, INFINITY);
  }
  say(SetConstraintMode{0});
  publish();
  EXPECT_TRUE(scene_->fields.empty());
}

TEST_F(Forces, BuzzHasDefaultsEndsByItselfAndAnyOtherEffectStopsIt) {
  say(StartCustomEffect{0, {}});
  publish();
  ASSERT_TRUE(scene_->buzz);
  EXPECT_EQ(scene_->buzz->force_N, Vec3(0, 0, 1));
  EXPECT_DOUBLE_EQ(scene_->buzz->angularFrequency_rad_per_s, 80 * EIGEN_PI);
  EXPECT_EQ(scene_->buzz->duration, 2'000 * kMillisecond);
  run(2'100 * kMillisecond);
  EXPECT_FALSE(scene_->buzz);
  say(StartCustomEffect{0, {2, 50, 10, 1, 0, 0, 99}});
  publish();
  EXPECT_EQ(scene_->buzz->force_N, Vec3(2, 0, 0));
  say(StartCustomEffect{17, {}});
  publish();
  EXPECT_FALSE(scene_->buzz);
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("no such custom effect"));
  say(StartCustomEffect{0, {}});
  say(StopCustomEffect{});
  publish();
  EXPECT_FALSE(scene_->buzz);
}

class ForcesOtherwise : public Forces {
 protected:
  static SceneConfig otherwise() {
    SceneConfig config;
    config.contactVibrationUnit = VibrationUnit::hertz;
    config.motorVibrationFrame = VibrationFrame::device;
    return config;
  }
  ForcesOtherwise() : Forces(otherwise()) {}
};

TEST_F(ForcesOtherwise, SwitchesReachTheSnapshot) {
  say(DefineEffect{.type = "vibrationContact", .index = 1, .magnitude_N = 1, .frequency = 100});
  say(DefineEffect{.type = "vibrationMotor", .index = 2, .magnitude_N = 1, .frequency = 100});
  say(StartEffect{1});
  say(StartEffect{2});
  publish();
  EXPECT_DOUBLE_EQ(scene_->effects.at(0).angularFrequency_rad_per_s, 200 * EIGEN_PI);
  EXPECT_TRUE(scene_->effects.at(1).inDeviceFrame);
}

}  // namespace
}  // namespace hapticd::scene

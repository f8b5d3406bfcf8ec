// Profile files of joysticks and wheels.
#include "device/evdev/wheel_profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

namespace hapticd::device {
namespace {

using testing::HasSubstr;

std::filesystem::path fileOf(const std::string& text) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const auto path = std::filesystem::path(testing::TempDir()) / (std::string(test->name()) + ".toml");
  std::ofstream(path) << text;
  return path;
}

std::string refusal(const std::string& text) {
  try {
    WheelProfile::load(fileOf(text));
    return "taken";
  } catch (const WheelProfileError& error) {
    return error.what();
  }
}

TEST(WheelProfile, IsRead) {
  const WheelProfile profile = WheelProfile::load(
      fileOf("force_N = 7.5\ncontinuous_force_N = 3\ntravel_x_m = 0.3\ninvert_force = true\naxes = 1\n"));
  EXPECT_TRUE(profile.measured);
  EXPECT_EQ(profile.force_N, 7.5);
  EXPECT_EQ(profile.continuousForce_N, 3);
  EXPECT_EQ(profile.travelX_m, 0.3);
  EXPECT_TRUE(profile.invertForce);
  EXPECT_EQ(profile.axes, 1);
  EXPECT_EQ(WheelProfile::load(fileOf("force_N = 4")).continuousForce_N, 2);
}

TEST(WheelProfile, ABadValueIsNamed) {
  EXPECT_THAT(refusal("damper = 1\nforce_N = -1"),
              HasSubstr(".toml:2: force_N must be a number from 0.05 to 100, got -1"));
  EXPECT_THAT(refusal("force_N = \"much\""),
              HasSubstr("force_N must be a number from 0.05 to 100, got 'much'"));
  EXPECT_THAT(refusal("axes = 1.5"), HasSubstr(".toml:1: axes must be a whole number from 0 to 2, got 1.5"));
  EXPECT_THAT(refusal("invert_force = 1"), HasSubstr(".toml:1: invert_force must be true or false, got 1"));
  EXPECT_THAT(refusal("axis = 1"), HasSubstr(".toml:1: unknown key 'axis'; did you mean 'axes'?"));
  EXPECT_THAT(refusal("strength = 1"),
              HasSubstr("unknown key 'strength'; use force_N, continuous_force_N, "));
  EXPECT_THAT(refusal("force_N = = 1"), HasSubstr(".toml:1: "));
  EXPECT_THROW(WheelProfile::load("/nowhere/wheel.toml"), WheelProfileError);
}

}  // namespace
}  // namespace hapticd::device

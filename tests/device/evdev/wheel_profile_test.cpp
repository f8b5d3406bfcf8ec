// Profile files of joysticks and wheels.
#include "device/evdev/wheel_profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

namespace hapticd::device {
namespace {

using testing::AllOf;
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
  EXPECT_THAT(refusal("force_N = -1"), AllOf(HasSubstr("force_N"), HasSubstr("0.05")));
  EXPECT_THAT(refusal("force_N = \"much\""), HasSubstr("force_N"));
  EXPECT_THAT(refusal("invert_force = 1"), HasSubstr("true or false"));
  EXPECT_THAT(refusal("strength = 1"), HasSubstr("unknown key"));
  EXPECT_THAT(refusal("force_N = = 1"), HasSubstr(".toml"));
  EXPECT_THROW(WheelProfile::load("/nowhere/wheel.toml"), WheelProfileError);
}

}  // namespace
}  // namespace hapticd::device

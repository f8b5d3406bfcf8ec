// The judge of the simulator by itself: what it calls a swallowed hand.
#include "sim/judge.h"

#include <gtest/gtest.h>

namespace hapticd::sim {
namespace {

constexpr double kTop_m = 0.020;
constexpr Nanos kTick = 1'000'000;

// A servo that ticks on time, with a cube whose top is at 20 mm.
class SwallowedHand : public testing::Test {
 protected:
  void tick(const Vec3& position_m, const Vec3& force_N, int times = 1) {
    for (int i = 0; i < times; ++i) {
      now_ += kTick;
      device::DeviceState state;
      state.position_m = position_m;
      state.velocity_m_per_s = velocity_m_per_s_;
      state.hold = hold_;
      judge_.onRead(now_, now_, true, state);
      judge_.onWrite(now_, force_N, true);
    }
  }
  // Above the cube until the forces have ramped in, then pressed against its top.
  void press() {
    tick({0, 0.025, 0}, Vec3::Zero(), 600);
    tick({0.004, 0.018, 0}, {0, 0.5, 0}, 100);
  }

  void rearm() { judge_.onRearm(now_); }

  std::vector<std::string> findings_;
  Vec3 velocity_m_per_s_ = Vec3::Zero();  // as the device tells it
  std::uint32_t hold_ = device::kHoldNone;

 private:
  Nanos now_ = 0;
  Judge judge_{{},
               {.finding = [this](const auto& text) { findings_.push_back(text); },
                .freeFrom = [] { return std::optional<Nanos>(); },
                .top =
                    [] {
                      return Judge::Top{kTop_m, kTop_m, 0.020};
                    }}};
};

TEST_F(SwallowedHand, is_below_the_top_and_not_pushed_up) {
  press();
  tick({0.004, 0.015, 0}, Vec3::Zero(), 60);
  ASSERT_EQ(findings_.size(), 1U);
  EXPECT_NE(findings_[0].find("swallowed"), std::string::npos) << findings_[0];
}

TEST_F(SwallowedHand, also_after_it_moved_to_the_rim) {
  press();
  tick({0.018, 0.017, 0}, {0, 0.5, 0}, 20);
  tick({0.004, 0.015, 0}, {0.5, 0, 0}, 60);
  EXPECT_EQ(findings_.size(), 1U);
}

TEST_F(SwallowedHand, is_not_one_that_leapt_beside_the_cube_and_is_held_by_its_side) {
  press();
  tick({0.0241, 0.018, 0}, Vec3::Zero(), 2);
  tick({0.004, 0.015, 0}, {0.5, 0, 0}, 100);
  EXPECT_TRUE(findings_.empty()) << findings_[0];
}

TEST_F(SwallowedHand, may_follow_when_it_came_back_over_the_top) {
  press();
  tick({0, 0.018, -0.0241}, Vec3::Zero(), 2);
  tick({0, 0.015, 0}, {0, 0, -0.5}, 100);
  press();
  tick({0.004, 0.015, 0}, Vec3::Zero(), 60);
  EXPECT_EQ(findings_.size(), 1U);
}

// It was too fast, and gets no force until a device without a fault has told that it is slow.
TEST_F(SwallowedHand, is_not_one_that_only_a_faulty_device_called_slow) {
  press();
  velocity_m_per_s_ = {0, 0, 2};
  tick({0.004, 0.025, 0}, Vec3::Zero(), 5);
  velocity_m_per_s_ = Vec3::Zero();
  hold_ = device::kHoldFault;
  tick({0.004, 0.025, 0}, Vec3::Zero(), 5);
  velocity_m_per_s_ = {0, 0, 0.6};
  hold_ = device::kHoldNone;
  tick({0.004, 0.025, 0}, Vec3::Zero());
  rearm();
  tick({0.004, 0.025, 0}, Vec3::Zero(), 600);
  tick({0.004, 0.015, 0}, Vec3::Zero(), 60);
  EXPECT_TRUE(findings_.empty()) << findings_[0];
  velocity_m_per_s_ = Vec3::Zero();
  tick({0.004, 0.025, 0}, Vec3::Zero(), 600);
  tick({0.004, 0.015, 0}, Vec3::Zero(), 60);
  EXPECT_EQ(findings_.size(), 1U);
}

}  // namespace
}  // namespace hapticd::sim

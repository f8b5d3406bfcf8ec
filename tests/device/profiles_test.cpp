// The table of devices.
#include "device/profiles.h"

#include <gtest/gtest.h>

namespace hapticd::device {
namespace {

TEST(Profiles, AreConsistent) {
  ASSERT_EQ(profiles().size(), 9U);
  for (const DeviceProfile& profile : profiles()) {
    EXPECT_EQ(findProfile(profile.model), &profile);
    EXPECT_FALSE(profile.workspace_m.empty());
    EXPECT_LE(profile.continuousForce_N, profile.peakForce_N);
    EXPECT_EQ(profile.startsArmed, profile.model == "simulated") << profile.model;
    EXPECT_NEAR(profile.workspace_m.centre().norm(), 0, 1e-15);
    EXPECT_GE(profile.inputDof, profile.outputDof) << profile.model;
    EXPECT_EQ(profile.hasGripper, profile.inputDof == 7) << profile.model;
  }
}

TEST(Profiles, AreFoundByEitherNameInAnyCase) {
  const DeviceProfile* touch = findProfile("omni");
  ASSERT_NE(touch, nullptr);
  EXPECT_EQ(touch->model, "Touch");
  EXPECT_EQ(touch->peakForce_N, 3.3);
  EXPECT_EQ(touch->continuousForce_N, 0.88);
  EXPECT_EQ(touch->ownDamping_Ns_per_m, 2.5);
  EXPECT_TRUE(touch->workspace_m.extents().isApprox(Vec3(0.160, 0.120, 0.070)));
  EXPECT_EQ(findProfile("TOUCH X"), findProfile("Desktop"));
  EXPECT_EQ(findProfile(""), nullptr);
  EXPECT_EQ(findProfile("Touch Y"), nullptr);
}

TEST(Profiles, AreToldOnOneLine) {
  EXPECT_EQ(
      inWords(*findProfile("Touch")),
      "Touch: 160 x 120 x 70 mm, 3.3 N (0.88 N for long), 500 N/m, 2.5 Ns/m, 6 degrees of freedom in and "
      "3 out, 2 buttons, inkwell switch");
  DeviceProfile profile = *findProfile("sigma.7");
  profile.switches = kHoldDeadMan;
  EXPECT_EQ(
      inWords(profile),
      "sigma.7: 190 x 190 x 130 mm, 12 N (12 N for long), 4000 N/m, 30 Ns/m, 7 degrees of freedom in and "
      "7 out, 2 buttons, presence switch, gripper");
}

}  // namespace
}  // namespace hapticd::device

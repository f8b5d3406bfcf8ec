#include "device/simulated/trajectory.h"

#include <gtest/gtest.h>

#include "device/simulated/hand_file.h"

namespace hapticd::device {
namespace {

using geometry::Vec3;

std::string trajectoryError(std::string_view text, const TrajectoryFormat& format = {}) {
  try {
    parseTrajectory(text, "probe.traj", format);
  } catch (const HandFileError& error) {
    return error.what();
  }
  return "";
}

TEST(Trajectory, TimesBeginAtTheFirstRowAndMillimetresBecomeMetres) {
  const Trajectory t =
      parseTrajectory("# measured\n\n100.5 1 2 3 0.1 0.2 0.3\r\n100.75\t4, 5; 6 0 0 1\n", "x", {});
  ASSERT_EQ(t.size(), 2U);
  EXPECT_EQ(t[0].time, 0);
  EXPECT_TRUE(t[0].position_m.isApprox(Vec3(0.001, 0.002, 0.003)));
  EXPECT_EQ(t[0].force_N, Vec3(0.1, 0.2, 0.3));
  EXPECT_EQ(t[1].time, 250'000'000);
  EXPECT_TRUE(t[1].position_m.isApprox(Vec3(0.004, 0.005, 0.006)));
}

TEST(Trajectory, ColumnsAndUnitsAreAsTheFormatSays) {
  const Trajectory t = parseTrajectory("1 9 2 3 1000\n", "x",
                                       {.columns = "x,-,y,z,t", .unitsPerMetre = 1, .unitsPerSecond = 1000});
  ASSERT_EQ(t.size(), 1U);
  EXPECT_EQ(t[0].position_m, Vec3(1, 2, 3));
  EXPECT_EQ(t[0].force_N, Vec3::Zero());
}

TEST(Trajectory, RowsThatRepeatATimeAreLeftOut) {
  EXPECT_EQ(parseTrajectory("0 0 0 0 0 0 0\n0 1 1 1 0 0 0\n1 0 0 0 0 0 0\n", "x", {}).size(), 2U);
}

TEST(Trajectory, ErrorsNameLineAndValue) {
  EXPECT_EQ(trajectoryError("0 0 0 0 0 0 0\n1 0 0\n"),
            "probe.traj:2: 3 numbers where 't,x,y,z,fx,fy,fz' has 7");
  EXPECT_EQ(trajectoryError("0 0 0 up 0 0 0\n"), "probe.traj:1: column 4 'up' is not a finite number");
  EXPECT_EQ(trajectoryError("0 0 0 inf 0 0 0\n"), "probe.traj:1: column 4 'inf' is not a finite number");
  EXPECT_NE(trajectoryError("5 0 0 0 0 0 0\n4 0 0 0 0 0 0\n").find("probe.traj:2: time 4"),
            std::string::npos);
  EXPECT_NE(trajectoryError("0 0 0 0 0 0 0\n1e9 0 0 0 0 0 0\n").find("is it in milliseconds?"),
            std::string::npos);
  EXPECT_NE(trajectoryError("1e308 0 0 0 0 0 0\n", {.unitsPerSecond = 1e-9}).find("out of range"),
            std::string::npos);
  EXPECT_NE(trajectoryError("0 1e308 0 0 0 0 0\n", {.unitsPerMetre = 1e-9}).find("out of range"),
            std::string::npos);
  EXPECT_EQ(trajectoryError("# nothing\n"), "probe.traj: no row with a sample in it");
}

TEST(Trajectory, AFormatWithoutSenseIsAnError) {
  EXPECT_EQ(trajectoryError("", {.columns = "t,x,y"}), "columns 't,x,y': 'z' must be there once");
  EXPECT_EQ(trajectoryError("", {.columns = "t,x,y,z,x"}), "columns 't,x,y,z,x': 'x' must be there once");
  EXPECT_EQ(trajectoryError("", {.columns = "t,x,y,z,w"}),
            "columns 't,x,y,z,w': 'w' is none of t, x, y, z, fx, fy, fz and -");
}

TEST(Trajectory, AHandFollowsItBetweenSamples) {
  const auto hand = HandFile::along(parseTrajectory("3 0 0 0 0 0 0\n3.01 10 0 0 0 0 0\n", "x", {}));
  EXPECT_EQ(hand->duration(), 10'000'000);
  EXPECT_NEAR(hand->at(2'500'000).position_m.x(), 0.0025, 1e-12);
  EXPECT_NEAR(hand->at(2'500'000).velocity_m_per_s.x(), 1, 1e-9);
}

}  // namespace
}  // namespace hapticd::device

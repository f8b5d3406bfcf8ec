// Trajectories: what is read of a text, with which units, and what is refused with which words.
#include "device/simulated/trajectory_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "device/simulated/hand_file.h"
#include "support/milliseconds.h"

namespace hapticd::device {
namespace {

std::string refusalOf(const std::string& text, const TrajectoryFormat& format = {}) {
  try {
    Trajectory::parse(text, "probe.traj", format);
  } catch (const HandFileError& error) {
    return error.what();
  }
  return "accepted";
}

TrajectoryFormat withColumns(std::string_view names) {
  return {.columns = TrajectoryColumns::parse(names)};
}

TEST(Trajectory, ReadsTimePositionInMillimetresAndForce) {
  const Trajectory read = Trajectory::parse("0 1 2 3 0.1 0.2 0.3\n0.0025 -4 5e1 .5 0 -1 +2\n", "t");
  ASSERT_EQ(read.samples.size(), 2U);
  EXPECT_TRUE(read.hasForce);
  EXPECT_EQ(read.samples[0].time, 0);
  EXPECT_TRUE(read.samples[0].position_m.isApprox(Vec3(0.001, 0.002, 0.003), 1e-15));
  EXPECT_EQ(read.samples[0].force_N, Vec3(0.1, 0.2, 0.3));
  EXPECT_EQ(read.samples[1].time, 2'500'000);
  EXPECT_TRUE(read.samples[1].position_m.isApprox(Vec3(-0.004, 0.05, 0.0005), 1e-15));
  EXPECT_EQ(read.samples[1].force_N, Vec3(0, -1, 2));
  EXPECT_EQ(read.remark, "");
}

TEST(Trajectory, ReadsPositionsWithoutForces) {
  const Trajectory read = Trajectory::parse("0 1 2 3\n0.001 1 2 3\n", "t");
  EXPECT_FALSE(read.hasForce);
  EXPECT_EQ(read.samples[1].force_N, Vec3::Zero());
}

TEST(Trajectory, AcceptsCommentsHeadersAndTheUsualSeparators) {
  const Trajectory read = Trajectory::parse(
      "# a scan\r\n% of a plane\n// by hand\n\ntime x y z\n"
      "0, 1,2 ,3 # the first\n  0.001\t4   5\t6  \r\n0.002;7; 8 ;9 % the last\n0.003 1 2 3// end",
      "t");
  ASSERT_EQ(read.samples.size(), 4U);
  EXPECT_TRUE(read.samples[0].position_m.isApprox(Vec3(0.001, 0.002, 0.003), 1e-15));
  EXPECT_TRUE(read.samples[1].position_m.isApprox(Vec3(0.004, 0.005, 0.006), 1e-15));
  EXPECT_TRUE(read.samples[2].position_m.isApprox(Vec3(0.007, 0.008, 0.009), 1e-15));
  EXPECT_EQ(read.remark, "skips 1 line(s) before the first sample");
}

TEST(Trajectory, UsesTheUnitsOfTheFormat) {
  const TrajectoryFormat format{.columns = {}, .unit_m = 1, .unit_s = 1e-3, .forceOnSurface = true};
  const Trajectory read = Trajectory::parse("5 0.1 0.2 0.3 1 -2 0.5\n7.5 0 0 0 0 0 0\n", "t", format);
  EXPECT_EQ(read.samples[0].time, 5 * kMs);
  EXPECT_EQ(read.samples[1].time, 7'500'000);
  EXPECT_EQ(read.samples[0].position_m, Vec3(0.1, 0.2, 0.3));
  EXPECT_EQ(read.samples[0].force_N, Vec3(-1, 2, -0.5));
}

TEST(Trajectory, ReadsColumnsInTheGivenOrder) {
  const Trajectory read =
      Trajectory::parse("9 3 2 1 0.5 8 6 5 4\n", "t", withColumns("-,z,y,x, t ,-,fz,fy,fx"));
  EXPECT_EQ(read.samples[0].time, 500 * kMs);
  EXPECT_TRUE(read.samples[0].position_m.isApprox(Vec3(0.001, 0.002, 0.003), 1e-15));
  EXPECT_EQ(read.samples[0].force_N, Vec3(4, 5, 6));
}

TEST(Trajectory, RefusesColumnsWithoutMeaning) {
  const auto refusal = [](std::string_view names) -> std::string {
    try {
      TrajectoryColumns::parse(names);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal("t,x,y"), "'z' is missing");
  EXPECT_EQ(refusal("x,y,z,fx,fy,fz"), "'t' is missing");
  EXPECT_EQ(refusal("t,x,y,z,q"), "'q' is none of t, x, y, z, fx, fy, fz and -");
  EXPECT_EQ(refusal("t,x,y,z,"), "'' is none of t, x, y, z, fx, fy, fz and -");
  EXPECT_EQ(refusal(""), "'' is none of t, x, y, z, fx, fy, fz and -");
  EXPECT_EQ(refusal("t,x,y,z,x"), "'x' is there twice");
  EXPECT_EQ(refusal("t,x,y,z,fz"), "fx, fy and fz come together");
  EXPECT_EQ(refusal("t,x,y,z"), "accepted");
}

TEST(Trajectory, NamesFileLineAndValueOfAnError) {
  EXPECT_EQ(refusalOf("0 0 0 0\n\n0.001 0 zero 0\n"), "probe.traj:3: column 3 'zero' is not a finite number");
  EXPECT_EQ(refusalOf("0 0 0 nan\n"), "probe.traj:1: column 4 'nan' is not a finite number");
  EXPECT_EQ(refusalOf("0,0,,0\n"), "probe.traj:1: column 3 '' is not a finite number");
  EXPECT_EQ(refusalOf("0 0 0 0\n0.001 0 0\n"), "probe.traj:2: 3 columns where 4 are expected");
  EXPECT_EQ(refusalOf("0 0 0 0\nend of data\n"), "probe.traj:2: 3 columns where 4 are expected");
  EXPECT_EQ(refusalOf("0 0 0 0 0 0\n"),
            "probe.traj:1: 6 columns where 4 (t,x,y,z) or 7 (t,x,y,z,fx,fy,fz) are expected: name them with "
            "--traj-columns");
  EXPECT_EQ(refusalOf("0 0 0 0 0\n", withColumns("t,x,y,z")), "probe.traj:1: 5 columns where 4 are expected");
  EXPECT_EQ(refusalOf("0 2e6 0 0\n"), "probe.traj:1: column 2 '2e6' is a position in m beyond 1000");
  EXPECT_EQ(refusalOf("0 0 0 0 0 0 -2e6\n"), "probe.traj:1: column 7 '-2e6' is a force in N beyond 1000000");
  EXPECT_EQ(refusalOf("-1e10 0 0 0\n"), "probe.traj:1: column 1 '-1e10' is a time in s beyond 9e+09");
  EXPECT_EQ(refusalOf(std::string("TRAJ\n1 \0\3 2\n", 12)),
            "probe.traj:2: holds binary data: a .traj file is read as text with one sample on each line");
  EXPECT_EQ(refusalOf(""), "probe.traj: no sample in it");
  EXPECT_EQ(refusalOf("# nothing\n"), "probe.traj: no sample in it");
  EXPECT_EQ(refusalOf("a mesh\nof words\n"), "probe.traj: no sample in it; no line begins with a number");
}

// A whole number and three with decimal commas are no time, position and force.
TEST(Trajectory, RefusesDecimalCommas) {
  const auto refusal = [](const std::string& row) {
    return "probe.traj:2: has commas in numbers or as some of the separators: give '" + row +
           "' decimal points, or one kind of separator";
  };
  for (const std::string row : {"5 1,5 2,5 30,5", "5;1,5;2,5;30,5", "0,5 1,5 2,5 30,5"})
    EXPECT_EQ(refusalOf("time x y z\n" + row + "\n"), refusal(row));
  EXPECT_EQ(refusalOf("t\n5\t1,5\t2,5\t30,5\n"), refusal("5 1,5 2,5 30,5"));
  for (const std::string row : {"5,1,2,3", "5, 1, 2, 3", "5 ,1 ,2 ,3", "5, 1,2 ,3", "5;1;2;3", "0.5 1,2 3"})
    EXPECT_EQ(refusalOf(row + "\n"), "accepted") << row;
}

TEST(Trajectory, RefusesTimeThatRunsBack) {
  EXPECT_EQ(refusalOf("5 0 0 0\n5.25 0 0 0\n5.125 0 0 0\n"),
            "probe.traj:3: time 5.125 s is before that of the sample before, 5.25 s");
  EXPECT_EQ(refusalOf("0 0 0 0\n2e8 0 0 0\n"),
            "probe.traj:2: time 200000000 s is more than 100000000 s after the first one");
}

TEST(Trajectory, SkipsRepeatedTimesWithARemark) {
  const Trajectory read = Trajectory::parse("0 1 0 0\n0.01 2 0 0\n0.01 3 0 0\n0.02 4 0 0\n", "t");
  ASSERT_EQ(read.samples.size(), 3U);
  EXPECT_EQ(read.samples[1].position_m.x(), 0.002);
  EXPECT_EQ(read.remark, "skips 1 sample(s) that repeat the time of the one before");
}

TEST(Trajectory, RemarksOnTimesThatMayBeMilliseconds) {
  EXPECT_EQ(Trajectory::parse("0 0 0 0\n1 0 0 0\n2 0 0 0\n", "t").remark,
            "has 1 samples per second; if its times are milliseconds, add --traj-time-unit ms");
  EXPECT_EQ(Trajectory::parse("0 0 0 0\n0.1 0 0 0\n0.15 0 0 0\n", "t").remark, "");
}

// A hand at another rate than the servo, whose clock does not begin at zero.
TEST(Trajectory, IsAHandThatBeginsAtItsFirstSample) {
  const auto hand =
      HandFile::of(Trajectory::parse("1700000000 0 0 0 1 1 1\n1700000000.004 4 -8 0 1 1 1\n", "t"));
  EXPECT_EQ(hand->rows(), 2U);
  EXPECT_EQ(hand->begin(), 0);
  EXPECT_EQ(hand->origin(), 1'700'000'000'000 * kMs);
  EXPECT_NEAR(static_cast<double>(hand->duration()), 4 * kMs, 1000);
  const HandPose quarter = hand->at(kMs);
  EXPECT_TRUE(quarter.position_m.isApprox(Vec3(0.001, -0.002, 0), 1e-3));
  EXPECT_TRUE(quarter.velocity_m_per_s.isApprox(Vec3(1, -2, 0), 1e-3));
  EXPECT_EQ(quarter.orientation.coeffs(), Quat::Identity().coeffs());
}

TEST(Trajectory, IsRecognisedByItsName) {
  EXPECT_TRUE(Trajectory::isNameOf("a/probe.traj"));
  EXPECT_TRUE(Trajectory::isNameOf("OUT.TRAJ"));
  EXPECT_FALSE(Trajectory::isNameOf("probe.traj.csv"));
  EXPECT_FALSE(Trajectory::isNameOf("traj"));

  const auto path = std::filesystem::temp_directory_path() / ("probe_" + std::to_string(getpid()) + ".traj");
  std::ofstream(path) << "7 1000 0 0\n7.1 2000 0 0\n";
  const auto millimetres = HandFile::load(path);
  const auto metres =
      HandFile::load(path, {.columns = {}, .unit_m = 0.1, .unit_s = 1, .forceOnSurface = false});
  std::filesystem::remove(path);
  EXPECT_NEAR(millimetres->at(0).position_m.x(), 1, 1e-12);
  EXPECT_NEAR(metres->at(0).position_m.x(), 100, 1e-12);
  EXPECT_EQ(millimetres->duration(), 100 * kMs);
  EXPECT_THAT([&] { HandFile::load(path); },
              testing::ThrowsMessage<HandFileError>(testing::HasSubstr(path.string())));
}

}  // namespace
}  // namespace hapticd::device

// Hand files: what is read, what lies between the rows, and what is refused with which words.
#include "device/simulated/hand_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "support/milliseconds.h"

namespace hapticd::device {
namespace {

std::string errorOf(const std::string& text) {
  try {
    HandFile::parse(text, "hand.csv");
  } catch (const HandFileError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(HandFile, InterpolatesPositionsBetweenRows) {
  const auto hand = HandFile::parse("t_s,x_m,y_m,z_m\n0,0,0,0\n0.010,0.01,-0.02,0\n0.020,0.01,0,0.04\n", "h");
  EXPECT_EQ(hand->rows(), 3U);
  EXPECT_EQ(hand->duration(), 20 * kMs);
  const HandPose middle = hand->at(5 * kMs);
  EXPECT_TRUE(middle.position_m.isApprox(Vec3(0.005, -0.01, 0), 1e-12));
  EXPECT_TRUE(middle.velocity_m_per_s.isApprox(Vec3(1, -2, 0), 1e-12));
  EXPECT_EQ(hand->at(10 * kMs).position_m, Vec3(0.01, -0.02, 0));
  EXPECT_EQ(middle.orientation.coeffs(), Quat::Identity().coeffs());
  EXPECT_EQ(middle.buttons, 0U);
}

TEST(HandFile, MayBeginWithAByteOrderMark) {
  EXPECT_EQ(HandFile::parse("\xEF\xBB\xBFt_s,x_m,y_m,z_m\n0,1,2,3\n", "h")->at(0).position_m, Vec3(1, 2, 3));
  EXPECT_EQ(HandFile::parse("\xEF\xBB\xBF"
                            "0,1,2,3\n1,4,5,6\n",
                            "h")
                ->rows(),
            2U);
}

TEST(HandFile, RestsBeforeTheFirstAndAfterTheLastRow) {
  const auto hand = HandFile::parse("0.01,1,2,3\n0.02,4,5,6", "h");
  EXPECT_EQ(hand->at(0).position_m, Vec3(1, 2, 3));
  EXPECT_EQ(hand->at(0).velocity_m_per_s, Vec3::Zero());
  EXPECT_EQ(hand->at(20 * kMs).position_m, Vec3(4, 5, 6));
  EXPECT_EQ(hand->at(9000 * kMs).position_m, Vec3(4, 5, 6));
  EXPECT_EQ(hand->at(9000 * kMs).velocity_m_per_s, Vec3::Zero());
}

TEST(HandFile, TurnsByTheShorterWay) {
  const double half = std::numbers::pi / 4;  // half of a quarter turn about z
  const std::string row = std::to_string(-std::sin(half)) + "," + std::to_string(-std::cos(half));
  const auto hand = HandFile::parse("0,0,0,0,0,0,0,1\n1,0,0,0,0,0," + row + "\n", "h");
  const Quat middle = hand->at(500 * kMs).orientation;
  EXPECT_NEAR(middle.angularDistance(Quat::Identity()), half, 1e-6);
}

TEST(HandFile, HoldsButtonsUntilTheNextRow) {
  const auto hand = HandFile::parse("t_s,x_m,y_m,z_m,buttons\n0,0,0,0,1\n1,0,0,0,2\n2,0,0,0,0\n", "h");
  EXPECT_EQ(hand->at(999 * kMs).buttons, 1U);
  EXPECT_EQ(hand->at(1000 * kMs).buttons, 2U);
  EXPECT_EQ(hand->at(2000 * kMs).buttons, 0U);
}

TEST(HandFile, AcceptsWhatEditorsDo) {
  const auto hand = HandFile::parse(
      "# a hand\r\n t_s, x_m, y_m, z_m, qx, qy, qz, qw, buttons\r\n\r\n0, +1e-3, 0,0, 0,0,0,1, 3\r\n", "h");
  EXPECT_EQ(hand->rows(), 1U);
  EXPECT_EQ(hand->duration(), 0);
  EXPECT_EQ(hand->at(0).position_m.x(), 1e-3);
  EXPECT_EQ(hand->at(0).buttons, 3U);
}

TEST(HandFile, NamesFileLineAndValueOfAnError) {
  EXPECT_EQ(errorOf("0,0,0,0\n0.001,0,zero,0\n"), "hand.csv:2: column 3 'zero' is not a finite number");
  EXPECT_EQ(errorOf("0,0,0,0\n\n0.001,0,nan,0\n"), "hand.csv:3: column 3 'nan' is not a finite number");
  EXPECT_EQ(errorOf("0,0,0,\n"), "hand.csv:1: column 4 '' is not a finite number");
  EXPECT_EQ(errorOf("0,0,0,0\n0,0,0,0\n"), "hand.csv:2: time 0.000000 s is not after the row before");
  EXPECT_EQ(errorOf("-1,0,0,0\n"), "hand.csv:1: time -1.000000 s is out of range");
  EXPECT_EQ(errorOf("0,0,0\n"), "hand.csv:1: 3 columns where 4, 5, 8 or 9 are expected");
  EXPECT_EQ(errorOf("0,0,0,0\n1,0,0,0,1\n"), "hand.csv:2: 5 columns where 4 are expected");
  EXPECT_EQ(errorOf("0,0,0,0,0,0,0,1,1,1\n"), "hand.csv:1: more than 9 columns");
  EXPECT_EQ(errorOf("t,x,y,z\n0,0,0,0\n"),
            "hand.csv:1: header 't,x,y,z' is not t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons] and has no columns "
            "time_ns,hip_x_m,hip_y_m,hip_z_m");
  EXPECT_EQ(errorOf("0,0,0,0,1,1,0,1\n"), "hand.csv:1: quaternion of length 1.732051 is not a rotation");
  EXPECT_EQ(errorOf("0,0,0,0,1.5\n"), "hand.csv:1: buttons 1.500000 is not a set of bits");
  EXPECT_EQ(errorOf(""), "hand.csv: no row with a hand in it");
  EXPECT_EQ(errorOf("t_s,x_m,y_m,z_m\n"), "hand.csv: no row with a hand in it");
}

// Sums and differences of what was read stay finite: times fit into 64 bits, interpolated positions into a
// double.
TEST(HandFile, RefusesTimesAndPositionsThatCannotBeSubtracted) {
  EXPECT_EQ(
      errorOf("time_ns,hip_x_m,hip_y_m,hip_z_m\n-9000000000000000000,0,0,0\n9000000000000000000,0,0,0\n"),
      "hand.csv:3: time 9000000000.000000 s is more than 1e8 s after the first row");
  EXPECT_EQ(errorOf("time_s,x_m,y_m,z_m\n-9e9,0,0,0\n9e9,0,0,0\n"),
            "hand.csv:3: time 9000000000.000000 s is more than 1e8 s after the first row");
  EXPECT_EQ(errorOf("0,0,1e308,0\n1,0,-1e308,0\n"),
            "hand.csv:1: column 3 '1e308' is a position beyond 1e6 m");
}

TEST(HandFile, ReadsWhatHapticdWrites) {
  const auto hand = HandFile::parse(
      "device,time_ns,tick,revision,hip_x_m,hip_y_m,hip_z_m,proxy_x_m,qx,qy,qz,qw,buttons,guard_active,"
      "gripper_rad\n"
      "\"Left, my\",1700000000123456789,1,1,0.01,0.02,0.03,9,0,0,0,1,2,late+speed,\n"
      "\"Left, my\",1700000000124456789,2,1,0.02,0.02,0.03,9,0,0,1,0,0,,\n",
      "h");
  EXPECT_EQ(hand->rows(), 2U);
  EXPECT_EQ(hand->begin(), 0);
  EXPECT_EQ(hand->duration(), 1 * kMs);
  EXPECT_EQ(hand->at(0).position_m, Vec3(0.01, 0.02, 0.03));
  EXPECT_EQ(hand->at(0).buttons, 2U);
  EXPECT_EQ(hand->at(kMs).orientation.coeffs(), Quat(0, 0, 0, 1).coeffs());
  EXPECT_EQ(hand->remark(), "");
}

TEST(HandFile, ReadsTheFilesOfOlderVersionsAndRemarksOnIt) {
  const struct {
    const char* text;
    const char* remark;
  } kCases[] = {
      // export and record, watch --csv, render --out, black box
      {"device,time_ns,tick,hand_x_m,hand_y_m,hand_z_m\nP,5000000,1,1,2,3\nP,6000000,2,4,5,6\n",
       "reads 'time_ns' and 'hand_x_m', columns of an older version of hapticd"},
      {"time_s,tick,hand_x_m,hand_y_m,hand_z_m\n1700000000.005000,1,1,2,3\n1700000000.006000,2,4,5,6\n",
       "reads 'time_s' and 'hand_x_m', columns of an older version of hapticd"},
      {"t_s,hip_x_m,hip_y_m,hip_z_m,depth_m\n0,1,2,3,0\n0.001,4,5,6,0\n",
       "reads 't_s' and 'hip_x_m', columns of an older version of hapticd"},
      {"tick,time_ns,x_m,y_m,z_m,active\n1,5000000,1,2,3,\n2,6000000,4,5,6,late\n",
       "reads 'time_ns' and 'x_m', columns of an older version of hapticd"},
  };
  for (const auto& c : kCases) {
    const auto hand = HandFile::parse(c.text, "h");
    EXPECT_EQ(hand->rows(), 2U);
    EXPECT_EQ(hand->begin(), 0);
    EXPECT_NEAR(static_cast<double>(hand->duration()), kMs, 1000);
    EXPECT_EQ(hand->at(hand->duration()).position_m, Vec3(4, 5, 6));
    EXPECT_EQ(hand->remark(), c.remark);
  }
  EXPECT_EQ(HandFile::parse("t_s,x_m,y_m,z_m\n0,0,0,0\n", "h")->remark(), "");
}

TEST(HandFile, SkipsRepeatedAndLateRowsOfARecordingWithARemark) {
  const auto hand = HandFile::parse(
      "device,time_ns,hip_x_m,hip_y_m,hip_z_m\nA,10,1,0,0\nA,20,2,0,0\nA,20,3,0,0\nA,15,4,0,0\nA,5,5,0,0\nA,"
      "30,6,0,0\n",
      "h");
  EXPECT_EQ(hand->rows(), 3U);
  EXPECT_EQ(hand->duration(), 20);
  EXPECT_EQ(hand->at(20).position_m.x(), 6);
  EXPECT_EQ(hand->remark(), "skips 3 row(s) whose time is not after that of a row before");
}

// All that follows a wall clock that was set back by years.
TEST(HandFile, RemarksOnEachRowThatItSkips) {
  const auto hand = HandFile::parse(
      "device,time_ns,hand_x_m,hand_y_m,hand_z_m\nA,1700000000000000000,1,0,0\nB,1700000000000000000,1,0,0\n"
      "A,1000,2,0,0\nA,2000,3,0,0\n",
      "h");
  EXPECT_EQ(hand->rows(), 1U);
  EXPECT_EQ(hand->remark(),
            "reads 'time_ns' and 'hand_x_m', columns of an older version of hapticd; holds several devices, "
            "only the first is used: A; skips 2 row(s) whose time is not after that of a row before");
}

TEST(HandFile, ReadsQuotesAroundCells) {
  const auto hand =
      HandFile::parse("\"\",\"t_s\",\"x_m\",\"y_m\",\"z_m\"\n\"1\",0,1,2,3\n\"2\",\"1\",4,5,6\n", "h");
  EXPECT_EQ(hand->rows(), 2U);
  EXPECT_EQ(hand->at(0).position_m, Vec3(1, 2, 3));
}

TEST(HandFile, SaysHowColumnsAreSeparated) {
  const std::string how = "hand.csv:1: columns end at commas, and numbers have a decimal point, got ";
  EXPECT_EQ(errorOf("t_s;x_m;y_m;z_m\n"), how + "'t_s;x_m;y_m;z_m'");
  EXPECT_EQ(errorOf("0;0;0;0,03\n"), how + "'0;0;0;0,03'");
  EXPECT_EQ(errorOf("0\t0\t0\t0.03\n"), how + "'0 0 0 0.03'");
}

// A recording, a text of UTF-16, a value of a megabyte: one line that a terminal can show.
TEST(HandFile, ShowsNoBytesThatAreNoText) {
  const std::string binary =
      ": holds binary data: a hand is text with one row on each line; 'hapticd export --to csv' "
      "makes it of a recording";
  EXPECT_EQ(errorOf(std::string("HAPTICS\n\0\0\0\1", 12)), "hand.csv:1" + binary);
  EXPECT_EQ(errorOf(std::string("\xff\xfe"
                                "0\0,\0",
                                6)),
            "hand.csv:1" + binary);
  EXPECT_EQ(errorOf("0,0,0,0\n1,0,\x1b[2J,0\n"), "hand.csv:2" + binary);
  EXPECT_EQ(errorOf("0,0,0,\xff\n"), "hand.csv:1: column 4 '\xef\xbf\xbd' is not a finite number");
  const std::string digits(1'000'000, 'x');
  EXPECT_EQ(errorOf("0,0,0," + digits + "\n"),
            "hand.csv:1: column 4 '" + digits.substr(0, 200) + "...' is not a finite number");
}

TEST(HandFile, UsesTheFirstOfSeveralDevices) {
  const auto hand = HandFile::parse(
      "device,time_ns,hip_x_m,hip_y_m,hip_z_m\nA,10,1,0,0\nB,10,2,0,0\nA,20,3,0,0\nB,20,4,0,0\n", "h");
  EXPECT_EQ(hand->rows(), 2U);
  EXPECT_EQ(hand->at(10).position_m.x(), 3);
  EXPECT_EQ(hand->remark(), "holds several devices, only the first is used: A");
}

TEST(HandFile, LoadsFromDiskAndNamesWhatIsNotThere) {
  const auto path = std::filesystem::temp_directory_path() / ("hand_" + std::to_string(getpid()) + ".csv");
  std::ofstream(path) << "0,1,2,3\n";
  EXPECT_EQ(HandFile::load(path)->at(0).position_m, Vec3(1, 2, 3));
  std::filesystem::remove(path);
  try {
    HandFile::load(path);
    FAIL() << "accepted";
  } catch (const HandFileError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(path.string()));
  }
}

}  // namespace
}  // namespace hapticd::device

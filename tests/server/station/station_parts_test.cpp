// Small parts between clients and a device: buttons, roles, steering the hand, stop and re-arm, black boxes.
#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "base/fake_world.h"
#include "base/time.h"
#include "base/world.h"
#include "device/simulated/simulated_device.h"
#include "hapticd/trips.h"
#include "server/hanging_files.h"
#include "server/session/roles.h"
#include "server/station/black_box_recorder.h"
#include "server/station/button_modes.h"
#include "server/station/device_control.h"

namespace hapticd::server {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;

TEST(ButtonModes, AToggleChangesWhenItsButtonIsPressed) {
  ButtonModes modes(2);
  std::vector<wire::ButtonAlert> alerts;
  std::string error;
  EXPECT_EQ(modes.apply(1, alerts), 1U);  // initially momentary
  EXPECT_EQ(modes.apply(0, alerts), 0U);
  EXPECT_TRUE(alerts.empty());

  ASSERT_TRUE(modes.setMode({0, wire::kButtonToggleOff}, error));
  EXPECT_EQ(modes.apply(0, alerts), 0U);
  EXPECT_EQ(alerts.size(), 1U);
  alerts.clear();
  EXPECT_EQ(modes.apply(1, alerts), 1U);
  EXPECT_EQ(modes.apply(1, alerts), 1U);  // held down
  EXPECT_EQ(modes.apply(0, alerts), 1U);  // released, still on
  ASSERT_EQ(alerts.size(), 1U);
  EXPECT_EQ(alerts[0].event, wire::kButtonToggleOn);
  EXPECT_EQ(modes.apply(3, alerts), 2U);  // off again; the other is momentary
  ASSERT_EQ(alerts.size(), 2U);
  EXPECT_EQ(alerts[1].event, wire::kButtonToggleOff);
}

TEST(ButtonModes, SetsAllButtonsAndTogglesThatAreInitiallyOn) {
  ButtonModes modes(2);
  std::vector<wire::ButtonAlert> alerts;
  std::string error;
  ASSERT_TRUE(modes.setMode({wire::kAllButtons, wire::kButtonToggleOn}, error));
  EXPECT_EQ(modes.apply(0, alerts), 3U);
  ASSERT_TRUE(modes.setMode({1, wire::kButtonMomentary}, error));
  EXPECT_EQ(modes.apply(0, alerts), 1U);
}

// As in VRPN.
TEST(ButtonModes, WhatIsAToggleKeepsItsStateWhenAllBecomeToggles) {
  ButtonModes modes(3);
  std::vector<wire::ButtonAlert> alerts;
  std::string error;
  ASSERT_TRUE(modes.setMode({1, wire::kButtonToggleOn}, error));
  EXPECT_EQ(modes.apply(0, alerts), 2U);
  alerts.clear();
  ASSERT_TRUE(modes.setMode({wire::kAllButtons, wire::kButtonToggleOff}, error));
  EXPECT_EQ(modes.apply(0, alerts), 2U);
  ASSERT_EQ(alerts.size(), 2U);
  EXPECT_EQ(alerts[0].button, 0);
  EXPECT_EQ(alerts[1].button, 2);
  EXPECT_EQ(modes.apply(1, alerts), 3U) << "the others are toggles now";
  EXPECT_EQ(modes.apply(0, alerts), 3U);
}

// However many Admin messages come between two ticks, and with as many buttons as there can be.
TEST(ButtonModes, OneTickTellsTheLastStateOfEachButtonThatChanged) {
  ButtonModes modes(32);
  std::vector<wire::ButtonAlert> alerts;
  std::string error;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(modes.setMode({wire::kAllButtons, wire::kButtonMomentary}, error));
    modes.apply(0, alerts);
  }
  EXPECT_TRUE(alerts.empty()) << "nothing changed";
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(modes.setMode({31, wire::kButtonToggleOff}, error));
    ASSERT_TRUE(modes.setMode({31, wire::kButtonToggleOn}, error));
  }
  EXPECT_EQ(modes.apply(0, alerts), 1U << 31U);
  ASSERT_EQ(alerts.size(), 1U);
  EXPECT_EQ(alerts[0].button, 31);
  EXPECT_EQ(alerts[0].event, wire::kButtonToggleOn);
  modes.apply(0, alerts);
  EXPECT_EQ(alerts.size(), 1U) << "told once";
  ASSERT_TRUE(modes.setMode({31, wire::kButtonMomentary}, error));
  EXPECT_EQ(modes.apply(0, alerts), 0U);
  ASSERT_EQ(alerts.size(), 2U);
  EXPECT_EQ(alerts[1].event, wire::kButtonToggleOff);
}

TEST(ButtonModes, RefusesUnknownButtonsAndModes) {
  ButtonModes modes(2);
  std::string error;
  EXPECT_FALSE(modes.setMode({2, wire::kButtonToggleOn}, error));
  EXPECT_NE(error.find("button 2 refused"), std::string::npos);
  EXPECT_FALSE(modes.setMode({0, 11}, error));
  EXPECT_NE(error.find("mode 11 refused"), std::string::npos);
}

TEST(Roles, PermitsAnyTheFirstOrListedClients) {
  Roles any(Control::any, {});
  EXPECT_TRUE(any.mayCommand(1, "10.0.0.1") && any.mayCommand(2, "10.0.0.2"));

  Roles first(Control::first, {});
  EXPECT_TRUE(first.mayCommand(1, "10.0.0.1"));
  EXPECT_FALSE(first.mayCommand(2, "10.0.0.1"));
  EXPECT_NE(first.reason().find("client 1"), std::string::npos);
  first.release(2);
  EXPECT_FALSE(first.mayCommand(2, "10.0.0.1"));
  first.release(1);
  EXPECT_TRUE(first.mayCommand(2, "10.0.0.1"));

  Roles list(Control::list, {"10.0.0.5"});
  EXPECT_TRUE(list.mayCommand(1, "10.0.0.5"));
  EXPECT_FALSE(list.mayCommand(1, "10.0.0.6"));
}

class HoldTest : public ::testing::Test {
 protected:
  HoldTest() { T_world_device_ = Eigen::Translation3d(100, 0, 0) * Eigen::UniformScaling<double>(1000.0); }
  // The position of the hand after two seconds.
  Vec3 handLater() {
    device::DeviceState state;
    for (int i = 0; i < 2000; ++i) {
      EXPECT_TRUE(hand_.read(now_ += 1'000'000, state));
      hand_.write(Vec3::Zero());
    }
    return state.position_m;
  }

  device::SimulatedDevice hand_;
  realtime::GuardControl guard_{true};
  DeviceControl control_{guard_, &hand_, hand_.profile().workspace_m};
  geometry::Affine T_world_device_;
  base::Nanos now_ = 0;
  Refusal refusal_;
};

TEST_F(HoldTest, ARearmNeverUndoesALaterStop) {
  scene::ClientId client = 0;  // each order comes by another connection
  const auto order = [&](base::Nanos received, base::Nanos sent, const char* address) {
    return DeviceControl::Order{received, sent, address, ++client};
  };
  const DeviceControl::Sender anyone{.client = 1, .key = 0, .description = "one", .mayCommand = true};
  const auto rearms = [&](const DeviceControl::Order& given) {
    return control_.rearmForces(given, anyone, false, refusal_);
  };
  control_.stopForces(order(100, 50, "10.0.0.1"), anyone);
  EXPECT_FALSE(rearms(order(99, 60, "10.0.0.1"))) << "received earlier";
  EXPECT_FALSE(rearms(order(100, 60, "10.0.0.1")));
  EXPECT_FALSE(rearms(order(101, 49, "10.0.0.1"))) << "sent earlier by the same machine";
  EXPECT_TRUE(guard_.stopped());
  control_.stopForces(order(100, 50, "127.0.0.1"), anyone);
  EXPECT_FALSE(rearms(order(101, 49, "127.0.0.2"))) << "this machine by either address";
  control_.stopForces(order(100, 50, "10.0.0.1"), anyone);
  EXPECT_TRUE(rearms(order(101, 49, "10.0.0.2"))) << "another machine has another clock";
  EXPECT_FALSE(guard_.stopped());
  control_.stopForces(order(200, 150, "10.0.0.1"), anyone);
  EXPECT_TRUE(rearms(order(201, 151, "10.0.0.1")));
}

class RearmTest : public HoldTest {
 protected:
  using Sender = DeviceControl::Sender;
  static Sender client(scene::ClientId id, std::uint64_t key = 0) {
    return {.client = id, .key = key, .description = "client " + std::to_string(id), .mayCommand = true};
  }
  void stop(const Sender& sender) { control_.stopForces({++time_, time_, "10.0.0.1"}, sender); }
  bool rearms(const Sender& sender, bool faults = false) {
    return control_.rearmForces({++time_, time_, "10.0.0.1"}, sender, faults, refusal_);
  }
  base::Nanos time_ = 0;
};

TEST_F(RearmTest, OnlyTheConnectionThatStoppedUndoesItsStop) {
  stop(client(1));
  EXPECT_FALSE(rearms(client(2)));
  EXPECT_EQ(refusal_.code, RefusalCode::stoppedByOther);
  EXPECT_NE(refusal_.text.find("client 1 stopped the forces"), std::string::npos) << refusal_.text;
  EXPECT_TRUE(guard_.stopped());
  EXPECT_TRUE(rearms(client(1)));
  EXPECT_FALSE(guard_.stopped());
}

TEST_F(RearmTest, AStopOfOnesOwnUndoesNoOther) {
  stop(client(1));
  stop(client(2));
  EXPECT_FALSE(rearms(client(2)));
  EXPECT_TRUE(guard_.stopped());
  control_.clientGone(1);
  EXPECT_FALSE(rearms(client(2))) << "and not when the other is gone";
  EXPECT_NE(refusal_.text.find("client 1 stopped the forces and is gone"), std::string::npos);
  EXPECT_TRUE(guard_.stopped());
}

TEST_F(RearmTest, ARefusalTellsWhoMayRearm) {
  const std::string stopped = "Rearm_Forces refused: client 1 stopped the forces";
  const std::string user =
      ", or the server's user on its machine: 'hapticd stop --rearm NAME@host', or NAME@unix:PATH if its "
      "socket "
      "is elsewhere";
  Sender sender = client(2);
  const auto refusal = [&](bool operators, bool socket) {
    sender.hasOperators = operators;
    sender.hasSocket = socket;
    EXPECT_FALSE(rearms(sender));
    return refusal_.text;
  };
  stop(client(1));
  EXPECT_EQ(refusal(true, true), stopped + "; it may re-arm, or an operator" + user);
  EXPECT_EQ(refusal(true, false), stopped + "; it may re-arm, or an operator");
  EXPECT_EQ(refusal(false, false), stopped + "; it may re-arm");
  control_.clientGone(1);
  EXPECT_EQ(refusal(true, true), stopped + " and is gone; an operator may re-arm" + user);
  EXPECT_EQ(refusal(true, false), stopped + " and is gone; an operator may re-arm");
  EXPECT_EQ(refusal(false, false), stopped + " and is gone; a page of the server in a browser may re-arm");
}

TEST_F(RearmTest, AnOperatorUndoesAllStops) {
  for (scene::ClientId id = 1; id < 100; ++id) {
    stop(client(id));
    if (id % 2 == 0) control_.clientGone(id);
  }
  Sender person = client(200);
  person.isOperator = true;
  person.hasOperators = true;
  EXPECT_TRUE(rearms(person, true));
  EXPECT_FALSE(guard_.stopped());
  stop(client(1));
  EXPECT_TRUE(rearms(client(1))) << "nothing is left of the others";
}

TEST_F(RearmTest, APageDoesOnceTheClientIsGoneAndThereIsNoOperator) {
  stop(client(1));
  Sender page = client(2);
  page.isPage = true;
  EXPECT_FALSE(rearms(page)) << "the client that stopped is there";
  control_.clientGone(1);
  page.hasOperators = true;
  EXPECT_FALSE(rearms(page)) << "an operator can do it";
  page.hasOperators = false;
  EXPECT_TRUE(rearms(page));
  stop(client(3));
  stop(page);
  EXPECT_FALSE(rearms(page)) << "it undoes its own";
  stop(page);
  control_.clientGone(3);
  EXPECT_TRUE(rearms(page)) << "its own, and that of the program that is gone";
}

TEST_F(RearmTest, TheConnectionsOfOneProgramAreOne) {
  stop(client(1, 77));
  stop(client(2, 77));
  control_.clientGone(1);
  EXPECT_TRUE(rearms(client(2, 77)));
  stop(client(3, 77));
  control_.clientGone(3);
  EXPECT_FALSE(rearms(client(4, 78)));
  EXPECT_TRUE(rearms(client(5, 77))) << "the program has connected again";
}

TEST_F(RearmTest, AProgramIsThereAsLongAsOneOfItsConnections) {
  Sender page = client(9);
  page.isPage = true;
  control_.setKey(1, 77);
  control_.setKey(2, 77);
  stop(client(1, 77));
  control_.clientGone(1);
  EXPECT_FALSE(rearms(page)) << "its other connection is there";
  EXPECT_EQ(refusal_.text, "Rearm_Forces refused: client 1 stopped the forces; it may re-arm");
  control_.setKey(2, 78);
  EXPECT_TRUE(rearms(page)) << "which is another program now";
  stop(client(3, 77));
  control_.clientGone(3);
  control_.setKey(4, 77);
  EXPECT_FALSE(rearms(page)) << "it has connected again";
  control_.clientGone(4);
  EXPECT_TRUE(rearms(page));
}

TEST_F(RearmTest, OneThatMayNotCommandUndoesItsStopButNoFault) {
  Sender observer = client(1);
  observer.mayCommand = false;
  EXPECT_FALSE(rearms(observer)) << "there is nothing of its own";
  EXPECT_EQ(refusal_.code, RefusalCode::notPermitted);
  stop(observer);
  EXPECT_FALSE(rearms(observer, true)) << "a fault is latched, too";
  EXPECT_TRUE(guard_.stopped());
  stop(observer);
  EXPECT_TRUE(rearms(observer));
}

TEST_F(RearmTest, ARefusalKeepsTheStop) {
  Sender observer = client(1);
  observer.mayCommand = false;
  stop(observer);
  EXPECT_FALSE(rearms(observer, true));
  EXPECT_TRUE(rearms(observer)) << "when the fault is gone";
  stop(client(2));
  control_.clientGone(2);
  Sender page = client(3);
  page.isPage = true;
  page.mayCommand = false;
  EXPECT_FALSE(rearms(page));
  EXPECT_FALSE(rearms(client(4))) << "the stop of the one that left stands";
  EXPECT_EQ(refusal_.code, RefusalCode::stoppedByOther);
}

// A re-arm waits until what its client sent before is published.
TEST_F(RearmTest, AnOlderOneDoesNotUndoAStopThatNoClientSent) {
  const Sender person = client(1);
  guard_.stop(100);
  EXPECT_FALSE(control_.rearmForces({100, 1, "10.0.0.1", 1}, person, false, refusal_));
  EXPECT_EQ(refusal_.code, RefusalCode::none);
  EXPECT_NE(refusal_.text.find("stopped after it was sent"), std::string::npos);
  EXPECT_TRUE(guard_.stopped());
  EXPECT_TRUE(control_.rearmForces({101, 2, "10.0.0.1", 1}, person, false, refusal_));
  EXPECT_FALSE(guard_.stopped());
}

TEST_F(RearmTest, WhoMayNotCommandUndoesNoStopThatNoClientSent) {
  Sender observer = client(1);
  observer.mayCommand = false;
  stop(observer);
  EXPECT_TRUE(rearms(observer)) << "its own";
  for (const bool machineFirst : {true, false}) {
    if (machineFirst) guard_.stop(++time_);
    stop(observer);
    if (!machineFirst) guard_.stop(++time_);
    EXPECT_FALSE(rearms(observer));
    EXPECT_EQ(refusal_.code, RefusalCode::notPermitted);
    EXPECT_NE(refusal_.text.find("not that of the server's machine"), std::string::npos) << refusal_.text;
    EXPECT_TRUE(guard_.stopped());
    EXPECT_FALSE(rearms(client(2))) << "the stop of the observer stands";
    observer.mayCommand = true;
    EXPECT_TRUE(rearms(observer));
    observer.mayCommand = false;
    EXPECT_FALSE(guard_.stopped());
  }
  stop(observer);
  EXPECT_TRUE(rearms(observer)) << "its own again";
}

TEST(GuardControl, ARearmDoesNotUndoAStopThatItDoesNotKnow) {
  realtime::GuardControl control(true);
  control.stop(5);
  const std::uint32_t known = control.stops();
  EXPECT_EQ(control.stoppedAt(), 5);
  control.stop(3);
  EXPECT_EQ(control.stoppedAt(), 5) << "the latest";
  EXPECT_FALSE(control.rearm(known));
  EXPECT_TRUE(control.stopped());
  EXPECT_TRUE(control.rearm(control.stops()));
  EXPECT_FALSE(control.stopped());
  EXPECT_TRUE(control.armed());
  EXPECT_EQ(control.read().rearms, 1U);
}

// Stops that nobody can undo do not grow without bound, and are not forgotten.
TEST_F(RearmTest, ManyStopsOfClientsThatLeftStand) {
  for (scene::ClientId id = 1; id <= 100'000; ++id) {
    stop(client(id, id));
    control_.clientGone(id);
  }
  EXPECT_FALSE(rearms(client(200'000, 50)));
  EXPECT_TRUE(guard_.stopped());
}

TEST_F(RearmTest, AClockThatIsSetBackKeepsNobodyFromRearming) {
  constexpr base::Nanos kNoon = 43'200'000'000'000;
  const Sender program = client(1, 7);  // with two connections
  const auto rearms = [&](base::Nanos sent, scene::ClientId connection) {
    return control_.rearmForces({101, sent, "10.0.0.1", connection}, program, false, refusal_);
  };
  const DeviceControl::Order stop{100, kNoon, "10.0.0.1", 1};
  control_.stopForces(stop, program);
  EXPECT_TRUE(rearms(kNoon - 1, 1)) << "the same connection";
  control_.stopForces(stop, program);
  EXPECT_FALSE(rearms(kNoon - DeviceControl::kLongestTravel, 2));
  EXPECT_TRUE(rearms(kNoon - DeviceControl::kLongestTravel - 1, 2));
  EXPECT_FALSE(guard_.stopped());
}

TEST_F(HoldTest, TheHandFollowsItsHolderAndReturnsWhenReleased) {
  hand_.open();
  ASSERT_TRUE(control_.hold(1, {.hold = 1, .position = {110, 20, 0}}, T_world_device_, refusal_))
      << refusal_.text;
  EXPECT_NEAR((handLater() - Vec3(0.01, 0.02, 0)).norm(), 0, 1e-4);
  EXPECT_FALSE(control_.hold(2, {.hold = 1, .position = {0, 0, 0}}, T_world_device_, refusal_));
  EXPECT_EQ(refusal_.code, RefusalCode::handHeldByOther);
  EXPECT_NE(refusal_.text.find("client 1 holds the hand"), std::string::npos);
  EXPECT_TRUE(control_.hold(2, {.hold = 0}, T_world_device_, refusal_));  // no effect
  EXPECT_NEAR((handLater() - Vec3(0.01, 0.02, 0)).norm(), 0, 1e-4);
  control_.clientGone(1);
  EXPECT_NEAR(handLater().norm(), 0, 1e-4);  // rests at the centre
  EXPECT_TRUE(control_.hold(2, {.hold = 1, .position = {100, 0, 10}}, T_world_device_, refusal_));
  EXPECT_NEAR((handLater() - Vec3(0, 0, 0.01)).norm(), 0, 1e-4);
}

TEST_F(HoldTest, TargetsAreClampedToTheWorkspace) {
  hand_.open();
  ASSERT_TRUE(control_.hold(1, {.hold = 1, .position = {100, 20000, 0}}, T_world_device_, refusal_));
  EXPECT_NEAR((handLater() - Vec3(0, hand_.profile().workspace_m.max.y(), 0)).norm(), 0, 1e-4);
}

TEST_F(HoldTest, RefusesInvalidPosesAndRealDevices) {
  EXPECT_FALSE(control_.hold(1, {.hold = 1, .position = {NAN, 0, 0}}, T_world_device_, refusal_));
  EXPECT_EQ(refusal_.code, RefusalCode::handPoseInvalid);
  EXPECT_FALSE(control_.hold(1, {.hold = 1, .orientation = {0, 0, 0, 0}}, T_world_device_, refusal_));
  EXPECT_NE(refusal_.text.find("zero quaternion"), std::string::npos);
  // A small turned map of the workspace makes infinite terms of finite numbers, and their sum undefined.
  T_world_device_.linear() = 1e-3 * Eigen::AngleAxisd(M_PI / 4, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_FALSE(control_.hold(1, {.hold = 1, .position = {1.7e308, 1.7e308, 0}}, T_world_device_, refusal_));
  EXPECT_EQ(refusal_.code, RefusalCode::handPoseInvalid);
  DeviceControl real(guard_, nullptr, {});
  EXPECT_FALSE(real.canBeHeld());
  EXPECT_FALSE(real.hold(1, {.hold = 1}, T_world_device_, refusal_));
  EXPECT_EQ(refusal_.code, RefusalCode::handNotSimulated);
  EXPECT_NE(refusal_.text.find("the device is real"), std::string::npos);
  DeviceControl recorded(guard_, nullptr, {}, false);
  EXPECT_FALSE(recorded.hold(1, {.hold = 1}, T_world_device_, refusal_));
  EXPECT_EQ(refusal_.code, RefusalCode::handNotSimulated);
  EXPECT_EQ(refusal_.text,
            "Hold_Hand refused: this device follows a recorded hand; only a simulated hand can be held");
}

class BlackBoxFilesTest : public ::testing::Test {
 protected:
  BlackBoxFilesTest()
      : directory_(fs::path(::testing::TempDir()) / ("black_box_" + std::to_string(::getpid()))) {}
  ~BlackBoxFilesTest() override { fs::remove_all(directory_); }

  void fail(realtime::BlackBox& box, int ticks) {
    realtime::TickReport tick;
    for (int i = 1; i <= ticks; ++i) {
      tick.tick = static_cast<std::uint64_t>(i);
      tick.force_N = Vec3(0, 0, i);
      if (i == ticks) tick.guard.latched = realtime::bit(realtime::Trip::speed);
      box.record(tick);
    }
    box.freeze();
  }
  std::vector<fs::path> files() const {
    std::vector<fs::path> found;
    for (const auto& entry : fs::directory_iterator(directory_ / "Phantom%2F1"))
      found.push_back(entry.path());
    return found;
  }

  fs::path directory_;
};

TEST_F(BlackBoxFilesTest, WritesAFaultWithTheTicksBeforeIt) {
  realtime::BlackBox box(5);
  BlackBoxRecorder recorder("Phantom/1", {directory_, 3}, box);
  recorder.poll();
  EXPECT_FALSE(fs::exists(directory_));
  fail(box, 8);
  recorder.poll();
  recorder.finish();
  ASSERT_EQ(files().size(), 1U);
  EXPECT_NE(files()[0].filename().string().find("-speed.csv"), std::string::npos);
  std::ifstream in(files()[0]);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 6U);
  const auto columns = [](const std::string& line) { return std::count(line.begin(), line.end(), ','); };
  for (const std::string& line : lines) EXPECT_EQ(columns(line), columns(lines[0]));
  const auto cell = [&](std::size_t line, const std::string& column) {
    const auto cells = [](const std::string& text) {
      std::vector<std::string> all;
      std::istringstream in_(text);
      for (std::string one; std::getline(in_, one, ',');) all.push_back(one);
      return all;
    };
    const auto names = cells(lines[0]);
    return cells(
        lines[line])[static_cast<std::size_t>(std::find(names.begin(), names.end(), column) - names.begin())];
  };
  EXPECT_EQ(cell(1, "tick"), "4");
  EXPECT_EQ(cell(5, "tick"), "8");
  EXPECT_EQ(cell(5, "guard_latched"), "speed");
  EXPECT_EQ(cell(5, "device"), "Phantom/1");
}

TEST_F(BlackBoxFilesTest, KeepsOnlyTheNewestFiles) {
  realtime::BlackBox box(5);
  BlackBoxRecorder recorder("Phantom/1", {directory_, 2}, box);
  fs::create_directories(directory_ / "Phantom%2F1");
  for (const char* foreign : {"a.csv", "20200101T000000.000Z.csv", "20200101T000000x000Z-speed.csv"})
    std::ofstream(directory_ / "Phantom%2F1" / foreign) << "a person's";
  for (int i = 0; i < 4; ++i) {
    fail(box, 2);
    recorder.poll();
    recorder.finish();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));  // file names have a resolution of 1 ms
  }
  EXPECT_EQ(files().size(), 2U + 3U) << "files of others stay";
}

TEST_F(BlackBoxFilesTest, KeepsTheNewestAlsoAfterTheClockWasSetBack) {
  realtime::BlackBox box(5);
  BlackBoxRecorder recorder("Phantom/1", {directory_, 2}, box);
  fs::create_directories(directory_ / "Phantom%2F1");
  for (const char* ahead : {"20991231T000000.000Z-speed.csv", "20991231T000001.000Z-speed.csv"})
    std::ofstream(directory_ / "Phantom%2F1" / ahead) << "ahead";
  fail(box, 2);
  recorder.poll();
  recorder.finish();
  const std::vector<fs::path> left = files();
  ASSERT_EQ(left.size(), 2U);
  EXPECT_EQ(std::count_if(left.begin(), left.end(),
                          [](const fs::path& file) { return file.filename().string().starts_with("2099"); }),
            1);
}

TEST_F(BlackBoxFilesTest, DevicesOfAnyNameHaveFoldersOfTheirOwn) {
  realtime::BlackBox box(5);
  const std::string longest(93, ' ');  // three characters each
  for (const std::string& name : {std::string("Left hand"), std::string("Left_hand"), std::string("\u5de6"),
                                  std::string("\u53f3"), longest + "1", longest + "2"}) {
    BlackBoxRecorder recorder(name, {directory_, 2}, box);
    fail(box, 2);
    recorder.poll();
    recorder.finish();
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(directory_), fs::directory_iterator()), 6);
  EXPECT_TRUE(fs::exists(directory_ / "Left%20hand"));
}

TEST_F(BlackBoxFilesTest, KeepsTheNewestWithinTheirBytes) {
  realtime::BlackBox box(5);
  BlackBoxRecorder recorder("Phantom/1", {directory_, 10, 1}, box);
  for (int i = 0; i < 3; ++i) {
    fail(box, 2);
    recorder.poll();
    recorder.finish();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    EXPECT_EQ(files().size(), 1U) << "the newest stays whatever its size";
  }
}

// Where room is made later, one would push out an older file that has ticks.
TEST_F(BlackBoxFilesTest, AFullDiskLeavesNoFileWithoutTicks) {
  base::FakeFiles files_;
  files_.freeBytes = 0;
  const base::World& world = base::world();
  const base::ScopedWorld scoped({world.clock, world.threads, files_, world.random});
  realtime::BlackBox box(5);
  BlackBoxRecorder recorder("Phantom", {"/boxes", 2}, box);
  fail(box, 2);
  recorder.poll();
  recorder.finish();
  EXPECT_FALSE(box.frozen());
  EXPECT_EQ(files_.list("/boxes/Phantom"), std::vector<std::string>{});
}

TEST_F(BlackBoxFilesTest, ADiskThatHangsHoldsNobodyUp) {
  test::HangingFiles files_;
  const base::World& world = base::world();
  const base::ScopedWorld scoped({world.clock, world.threads, files_, world.random});
  realtime::BlackBox box(5);
  BlackBoxRecorder recorder("Phantom/1", {directory_, 3}, box);
  fail(box, 2);
  recorder.poll();
  std::this_thread::sleep_for(std::chrono::milliseconds(2));
  fail(box, 2);
  recorder.poll();
  EXPECT_TRUE(box.frozen()) << "it waits for its turn";
  files_.answer();
  recorder.finish();
  EXPECT_FALSE(box.frozen());
  EXPECT_EQ(files().size(), 2U);
}

// As of a machine that is out of threads or memory, for the next one that starts.
class RefusingThreads final : public base::Threads {
 public:
  std::unique_ptr<base::Thread::Impl> start(base::ThreadOptions options, base::Step step) override {
    if (std::exchange(refuses_, false)) throw std::system_error(EAGAIN, std::generic_category());
    return system_.start(std::move(options), std::move(step));
  }
  std::unique_ptr<base::BlockingThread::Impl> startBlocking(base::ThreadOptions options,
                                                            std::function<void()> body) override {
    return system_.startBlocking(std::move(options), std::move(body));
  }
  std::unique_ptr<base::PacedThread::Impl> startPaced(base::ThreadOptions options, base::Clock& clock,
                                                      base::Step step) override {
    return system_.startPaced(std::move(options), clock, std::move(step));
  }

 private:
  base::SystemThreads system_;
  bool refuses_ = true;
};

TEST_F(BlackBoxFilesTest, AMachineOutOfThreadsLosesOneOnly) {
  RefusingThreads threads;
  const base::World& world = base::world();
  const base::ScopedWorld scoped({world.clock, threads, world.files, world.random});
  realtime::BlackBox box(5);
  BlackBoxRecorder recorder("Phantom/1", {directory_, 3}, box);
  for (int fault = 0; fault < 2; ++fault) {
    fail(box, 2);
    EXPECT_NO_THROW(recorder.poll());
  }
  recorder.finish();
  EXPECT_FALSE(box.frozen());
  EXPECT_EQ(files().size(), 1U);
}

std::string_view effectOn(TripAction action) {
  switch (action) {
    case TripAction::clamp:
      return "shaped";
    case TripAction::hold:
      return "zero while it lasts";
    case TripAction::latch:
      return "zero until re-armed";
  }
  return {};
}

TEST(Trips, AreInTheDocumentWithTheirSentences) {
  std::ifstream in(HAPTICD_TESTDATA "/../docs/safety.md");
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  ASSERT_FALSE(text.empty());
  for (const TripInfo& trip : kTrips) {
    std::ostringstream row;
    row << "| " << static_cast<int>(trip.trip) << " | `" << trip.name << "` | " << effectOn(trip.action)
        << " | " << static_cast<int>(trip.forceError) << " | " << trip.what << " | " << trip.remedy << " |\n";
    EXPECT_NE(text.find(row.str()), std::string::npos) << row.str();
  }
}

}  // namespace
}  // namespace hapticd::server

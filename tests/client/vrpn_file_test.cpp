// Log files of VRPN that its devices open.
#include <gtest/gtest.h>
#include <unistd.h>
#include <vrpn_Button.h>
#include <vrpn_Connection.h>
#include <vrpn_FileConnection.h>
#include <vrpn_FileController.h>
#include <vrpn_Text.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/client_tests.h"
#include "client/vrpn_both_sides.h"

namespace hapticd {
namespace {

using test::Arrived;
using test::kPatience;
using test::ofNumbers;
using test::Payloads;

// A log file of a conversation with VRPN: heads in memory order, payloads without padding.
class VrpnFile : public ::testing::Test {
 protected:
  VrpnFile() {
    put("vrpn: ver. 07.38  0");
    bytes_.resize(24);
    describe(-1, 3, "Device");
    describe(-2, 5, "vrpn_Button Change");
    for (int i = 0; i < 4; ++i) {
      entry(5, 3, 100 + i, 8);
      number(i);
      number(1);
    }
    std::ofstream(path_, std::ios::binary) << bytes_;
  }
  ~VrpnFile() override { std::remove(path_.c_str()); }
  void put(const std::string& text) { bytes_ += text; }
  void number(std::int32_t value) {
    for (const int shift : {24, 16, 8, 0}) bytes_ += static_cast<char>(value >> shift);
  }
  void entry(std::int32_t type, std::int32_t sender, std::int32_t second, std::size_t length) {
    for (const std::int32_t value : {type, sender, second, 500000, static_cast<std::int32_t>(length), 0})
      number(value);
  }
  void describe(std::int32_t kind, std::int32_t id, const std::string& name) {
    entry(kind, id, 100, name.size() + 5);
    number(static_cast<std::int32_t>(name.size()) + 1);
    put(name + '\0');
  }

  std::string bytes_;
  std::string path_ = ::testing::TempDir() + "vrpn_file_" + std::to_string(getpid()) + ".vrpn";
};

TEST_F(VrpnFile, IsPlayedToADeviceThatOpensIt) {
  vrpn_Button_Remote button(("Device@file://" + path_).c_str());
  vrpn_File_Connection* file = button.connectionPtr()->get_File_Connection();
  ASSERT_NE(file, nullptr);
  EXPECT_TRUE(file->doing_okay());
  EXPECT_EQ(file->get_length_secs(), 3);
  std::vector<vrpn_BUTTONCB> changes;
  button.register_change_handler(&changes, [](void* list, const vrpn_BUTTONCB report) {
    static_cast<std::vector<vrpn_BUTTONCB>*>(list)->push_back(report);
  });
  file->set_replay_rate(0);
  button.mainloop();
  button.mainloop();
  ASSERT_EQ(changes.size(), 1U) << "the first message is due at once";
  EXPECT_EQ(changes[0].msg_time.tv_sec, 100);
  EXPECT_EQ(file->playone(), 0);
  EXPECT_EQ(changes.back().button, 1);
  file->play_to_time(3.0);
  EXPECT_EQ(changes.size(), 4U);
  EXPECT_TRUE(file->eof());
  EXPECT_EQ(file->playone(), -1);
  EXPECT_EQ(file->jump_to_time(2.0), 1) << "as VRPN: it got there";
  EXPECT_EQ(file->get_time().tv_sec, 102);
  EXPECT_EQ(file->jump_to_time(99.0), 0) << "behind the last message";
  EXPECT_EQ(file->jump_to_filetime({102, 0}), 1);
  EXPECT_EQ(file->playone(), 0);
  EXPECT_EQ(changes.back().button, 2);
  file->reset();
  file->set_replay_rate(1e9F);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!file->eof() && std::chrono::steady_clock::now() < end) button.mainloop();
  EXPECT_EQ(changes.size(), 9U);
}

TEST_F(VrpnFile, IsPlayedByAController) {
  vrpn_File_Connection file(("file:" + path_).c_str());
  EXPECT_TRUE(file.connected());
  EXPECT_EQ(file.get_filename(), path_);
  Payloads changes;
  file.register_handler(file.register_message_type("vrpn_Button Change"), Arrived::keep, &changes);
  vrpn_File_Controller controller(&file);
  controller.set_replay_rate(2.5F);
  EXPECT_EQ(file.get_replay_rate(), 2.5F);
  controller.play_to_time({1, 0});
  EXPECT_EQ(changes, (Payloads{ofNumbers({0, 1}), ofNumbers({1, 1})}));
  controller.reset();
  controller.set_replay_rate(1e9F);
  changes.clear();
  file.limit_messages_played_back(3);
  file.mainloop();
  const timeval moment{0, 1};
  file.mainloop(&moment);
  EXPECT_EQ(changes.size(), 4U) << "one that is due at once, then three";
  EXPECT_EQ(file.playone(), -1) << "as VRPN at the end";
  EXPECT_EQ(file.playone_to_filetime({200, 0}), 1);
}

TEST_F(VrpnFile, MustBeALogOfVrpn) {
  for (const std::string contents : {"", "vrpn", "a text that is not a log of VRPN at all"}) {
    std::ofstream(path_, std::ios::binary) << contents;
    ::testing::internal::CaptureStderr();
    EXPECT_FALSE(vrpn_File_Connection(("file:" + path_).c_str()).doing_okay());
    EXPECT_EQ(::testing::internal::GetCapturedStderr(), "VRPN: " + path_ + " is not a log file of VRPN\n");
  }
}

TEST_F(VrpnFile, IsClosedWhenAHandlerDeletesItsLastDevice) {
  const std::string name = "file:" + path_;
  auto button = std::make_unique<vrpn_Button_Remote>(("Device@" + name).c_str());
  vrpn_Connection* connection = button->connectionPtr();
  EXPECT_EQ(vrpn_ConnectionManager::instance().getByName(name.c_str()), connection);
  connection->register_handler(
      vrpn_ANY_TYPE,
      [](void* device, vrpn_HANDLERPARAM) {
        static_cast<std::unique_ptr<vrpn_Button_Remote>*>(device)->reset();
        return 0;
      },
      &button);
  connection->mainloop();
  EXPECT_EQ(button, nullptr);
  EXPECT_EQ(vrpn_ConnectionManager::instance().getByName(name.c_str()), nullptr);
}

// However often mainloop() is called. The clock runs on between its calls and those of the test.
TEST_F(VrpnFile, IsPlayedAtItsRate) {
  const auto passed_ms = [](const timeval& from) {
    timeval now{};
    vrpn_gettimeofday(&now);
    return vrpn_TimevalMsecs(vrpn_TimevalDiff(now, from));
  };
  for (const double rate : {0.25, 1.5}) {
    vrpn_File_Connection file(("file:" + path_).c_str());
    file.set_replay_rate(static_cast<float>(rate));
    timeval before{};
    timeval after{};
    vrpn_gettimeofday(&before);
    file.mainloop();
    vrpn_gettimeofday(&after);
    double least_ms = 0;
    do {
      least_ms = passed_ms(after);
      file.mainloop();
    } while (least_ms < 100);
    const double most_ms = passed_ms(before);
    timeval position{};
    file.time_since_connection_open(&position);
    constexpr double kRounding_ms = 0.01;
    EXPECT_GE(vrpn_TimevalMsecs(position), rate * least_ms - kRounding_ms);
    EXPECT_LE(vrpn_TimevalMsecs(position), rate * most_ms + kRounding_ms);
    EXPECT_EQ(vrpn_TimevalMsecs(vrpn_TimevalDiff(file.get_time(), file.get_lowest_user_timestamp())),
              vrpn_TimevalMsecs(position))
        << "its time is that of the file";
  }
}

TEST_F(VrpnFile, IsPlayedToItsEndByAVeryLargeTimeOrRate) {
  vrpn_File_Connection file(("file:" + path_).c_str());
  file.play_to_time(1e18);
  EXPECT_TRUE(file.eof());
  file.mainloop();
  file.reset();
  file.set_replay_rate(1e30F);
  file.mainloop();
  const timeval tenth{0, 100000};
  file.mainloop(&tenth);
  EXPECT_TRUE(file.eof());
}

std::unique_ptr<vrpn_Button_Remote> ofTheProgram;

TEST_F(VrpnFile, ADeviceInAGlobalVariableEndsWithTheProgram) {
  const auto program = [&] {
    ofTheProgram = std::make_unique<vrpn_Button_Remote>(("Device@file://" + path_).c_str());
    std::exit(0);
  };
  EXPECT_EXIT(program(), ::testing::ExitedWithCode(0), "");
}

// The names of one file differ, so that the threads do not share a connection.
TEST_F(VrpnFile, ThreadsMayHaveAConnectionEach) {
  const auto useRepeatedly = [&](const char* scheme) {
    for (int i = 0; i < 5000; ++i) {
      vrpn_Button_Remote button((std::string("Device@") + scheme + path_).c_str());
      vrpn_Text_Sender device("Device", button.connectionPtr());
      device.send_message("a text that is too harmless to be printed");
    }
  };
  std::thread other([&] { useRepeatedly("file:"); });
  useRepeatedly("file://");
  other.join();
}

TEST_F(VrpnFile, ADamagedEndIsLeftOut) {
  std::ofstream(path_, std::ios::binary) << bytes_.substr(0, bytes_.size() - 3);
  vrpn_File_Connection file(("file:" + path_).c_str());
  EXPECT_TRUE(file.doing_okay());
  EXPECT_EQ(file.get_length_secs(), 2);
  vrpn_File_Connection absent("file:/nowhere/x.vrpn");
  EXPECT_FALSE(absent.doing_okay());
  EXPECT_EQ(absent.mainloop(), -1);
}

}  // namespace
}  // namespace hapticd

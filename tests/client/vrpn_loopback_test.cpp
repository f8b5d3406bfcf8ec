// VRPN's devices and their remotes in one program.
#include <gtest/gtest.h>
#include <unistd.h>
#include <vrpn_Analog.h>
#include <vrpn_Button.h>
#include <vrpn_Connection.h>
#include <vrpn_ForceDevice.h>
#include <vrpn_Text.h>
#include <vrpn_Tracker.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/vrpn_both_sides.h"
#include "client/vrpn_device.h"
#include "net/loopback.h"

namespace hapticd {
namespace {

using test::Arrived;
using test::ofNumbers;
using test::Payloads;
using test::ServedConnection;

// One device of several classes, used by a remote in the same program.
class Mixed : public vrpn_Tracker, public vrpn_Button_Filter, public vrpn_Analog {
 public:
  explicit Mixed(vrpn_Connection* connection)
      : vrpn_Tracker("Mixed", connection),
        vrpn_Button_Filter("Mixed", connection),
        vrpn_Analog("Mixed", connection) {
    num_buttons = 2;
    num_channel = 1;
  }
  void mainloop() override {
    server_mainloop();
    buttons[1] = 1;
    channel[0] = 0.25;
    vrpn_Button_Filter::report_changes();
    vrpn_Analog::report_changes();
  }
};

TEST(VrpnLoopback, ServesRemotesOfTheSameProgram) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  ASSERT_TRUE(connection);
  EXPECT_EQ(connection->servedPort(), 0);
  Mixed device(connection.get());
  vrpn_Button_Remote button("Mixed", connection.get());
  vrpn_Analog_Remote analog("Mixed", connection.get());
  std::vector<vrpn_BUTTONCB> changes;
  std::vector<vrpn_ANALOGCB> channels;
  button.register_change_handler(&changes, [](void* list, const vrpn_BUTTONCB report) {
    static_cast<std::vector<vrpn_BUTTONCB>*>(list)->push_back(report);
  });
  analog.register_change_handler(&channels, [](void* list, const vrpn_ANALOGCB report) {
    static_cast<std::vector<vrpn_ANALOGCB>*>(list)->push_back(report);
  });
  button.set_toggle(1, 0);
  for (int i = 0; i < 3; ++i) {
    device.mainloop();
    button.mainloop();
  }
  ASSERT_EQ(changes.size(), 1U);
  EXPECT_EQ(changes[0].button, 1);
  EXPECT_EQ(changes[0].state, 1);
  EXPECT_EQ(device.buttonstate[1], vrpn_BUTTON_TOGGLE_ON);
  ASSERT_EQ(channels.size(), 1U);
  EXPECT_EQ(channels[0].channel[0], 0.25);
}

class StillTracker : public vrpn_Tracker_NULL {
 public:
  using vrpn_Tracker_NULL::vrpn_Tracker_NULL;
  timeval& last() { return timestamp; }
};

TEST(VrpnLoopback, TheNullTrackerReportsEachSensorAtItsRate) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  StillTracker tracker("Still", connection.get(), 2, 1e-3);
  vrpn_Tracker_Remote remote("Still", connection.get());
  struct Seen {
    std::string reports;
    void add(char kind, vrpn_int32 sensor, const vrpn_float64* v, const vrpn_float64* q) {
      reports += std::string{kind} + std::to_string(sensor);
      EXPECT_EQ(v[0] * v[0] + v[1] * v[1] + v[2] * v[2], 0);
      EXPECT_EQ(q[0] * q[0] + q[1] * q[1] + q[2] * q[2], 0);
      EXPECT_EQ(q[3], 1);
    }
  } seen;
  remote.register_change_handler(&seen, [](void* self, const vrpn_TRACKERCB r) {
    static_cast<Seen*>(self)->add('p', r.sensor, r.pos, r.quat);
  });
  remote.register_change_handler(&seen, [](void* self, const vrpn_TRACKERVELCB r) {
    static_cast<Seen*>(self)->add('v', r.sensor, r.vel, r.vel_quat);
    EXPECT_EQ(r.vel_quat_dt, 1);
  });
  remote.register_change_handler(&seen, [](void* self, const vrpn_TRACKERACCCB r) {
    static_cast<Seen*>(self)->add('a', r.sensor, r.acc, r.acc_quat);
    EXPECT_EQ(r.acc_quat_dt, 1);
  });
  const auto reported = [&] {
    seen.reports.clear();
    tracker.mainloop();
    return seen.reports;
  };
  const std::string all = "p0v0a0p1v1a1";
  EXPECT_EQ(reported(), all);
  EXPECT_EQ(reported(), "");
  tracker.last().tv_sec -= 500;
  EXPECT_EQ(reported(), "");
  tracker.last().tv_sec -= 600;
  EXPECT_EQ(reported(), all);
  tracker.last().tv_sec += 100000;
  EXPECT_EQ(reported(), all) << "the clock was set back";
}

TEST(VrpnLoopback, ReportsOfSensorsThatATrackerHasNotAreRefused) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Tracker_Server tracker("Tracker", connection.get(), 2);
  const vrpn_float64 at[3] = {1, -2, 0.5}, turned[4] = {0, 0.6, 0, -0.8};
  EXPECT_EQ(tracker.report_pose(2, {1, 0}, at, turned), -1);
  EXPECT_EQ(tracker.report_pose(-1, {1, 0}, at, turned), -1);
  EXPECT_EQ(tracker.report_pose(1, {1, 0}, at, turned), 0);
  ::testing::internal::CaptureStdout();
  tracker.print_latest_report();
  EXPECT_EQ(::testing::internal::GetCapturedStdout(),
            "sensor 1 of Tracker: position 1 -2 0.5 m, quaternion 0 0.6 0 -0.8\n");
}

// As VRPN: what is a toggle already keeps its state, and only changes are alerts.
TEST(VrpnLoopback, AllButtonsBecomeTogglesOrMomentary) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Button_Server server("Buttons", connection.get(), 3);
  server.set_alerts(1);
  vrpn_Button_Remote remote("Buttons", connection.get());
  Payloads alerts;
  connection->register_handler(connection->register_message_type("vrpn_Button Alert"), Arrived::keep,
                               &alerts);
  const auto states = [&] { return std::vector<vrpn_int32>(server.buttonstate, server.buttonstate + 3); };
  const auto alerted = [&] { return std::exchange(alerts, {}); };
  remote.set_toggle(1, vrpn_BUTTON_TOGGLE_ON);
  EXPECT_EQ(alerted(), (Payloads{ofNumbers({1, 21})}));
  remote.set_all_toggle(vrpn_BUTTON_TOGGLE_OFF);
  EXPECT_EQ(states(), (std::vector<vrpn_int32>{20, 21, 20}));
  EXPECT_EQ(alerted(), (Payloads{ofNumbers({0, 20}), ofNumbers({2, 20})}));
  remote.set_momentary(0);
  EXPECT_EQ(alerted(), (Payloads{ofNumbers({0, 20})}));
  remote.set_all_momentary();
  EXPECT_EQ(states(), (std::vector<vrpn_int32>{10, 10, 10}));
  EXPECT_EQ(alerted(), (Payloads{ofNumbers({1, 20}), ofNumbers({2, 20})}));
  for (const std::uint32_t event : {0U, 7U, 22U}) {  // not events of VRPN
    const std::string payload = ofNumbers({1, event});
    connection->pack_message(8, {}, connection->register_message_type("vrpn_Button Admin"),
                             connection->register_sender("Buttons"), payload.data(),
                             vrpn_CONNECTION_RELIABLE);
  }
  server.set_toggle(3, vrpn_BUTTON_TOGGLE_ON);
  server.set_toggle(-1, vrpn_BUTTON_TOGGLE_ON);
  server.set_momentary(3);
  EXPECT_EQ(states(), (std::vector<vrpn_int32>{10, 10, 10}));
  EXPECT_EQ(alerted(), Payloads{});
  server.set_all_toggle(vrpn_BUTTON_TOGGLE_ON);
  EXPECT_EQ(states(), (std::vector<vrpn_int32>{21, 21, 21}));
}

// A device without toggles.
class Panel : public vrpn_Button, public vrpn_Analog {
 public:
  explicit Panel(vrpn_Connection* connection)
      : vrpn_Button("Panel", connection), vrpn_Analog("Panel", connection) {
    num_buttons = 3;
    num_channel = 2;
  }
  void mainloop() override { vrpn_Button::report_changes(); }
  void press(int button, unsigned char state) {
    vrpn_Button::timestamp = {40 + button, 7};
    buttons[button] = state;
  }
  void turn(double value) { channel[1] = value; }
  void reportAll() { vrpn_Button::report_states(); }
};

TEST(VrpnLoopback, APanelReportsItsButtonsOncePerChange) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  Panel panel(connection.get());
  Payloads changes, states;
  connection->register_handler(connection->register_message_type("vrpn_Button Change"), Arrived::keep,
                               &changes);
  connection->register_handler(connection->register_message_type("vrpn_Button States"), Arrived::keep,
                               &states);
  vrpn_Button_Remote remote("Panel", connection.get());
  std::vector<timeval> times;
  remote.register_change_handler(&times, [](void* list, const vrpn_BUTTONCB report) {
    static_cast<std::vector<timeval>*>(list)->push_back(report.msg_time);
  });
  panel.mainloop();
  panel.press(2, 1);
  panel.mainloop();
  panel.mainloop();
  panel.press(0, 1);
  panel.press(2, 0);
  panel.mainloop();
  EXPECT_EQ(changes, (Payloads{ofNumbers({2, 1}), ofNumbers({0, 1}), ofNumbers({2, 0})}));
  ASSERT_EQ(times.size(), 3U);
  EXPECT_EQ(times[0].tv_sec, 42);
  EXPECT_EQ(times[0].tv_usec, 7);
  panel.reportAll();
  EXPECT_EQ(states, (Payloads{ofNumbers({3, 1, 0, 0})}));
  panel.turn(-0.5);
  ::testing::internal::CaptureStdout();
  panel.vrpn_Button::print();
  panel.vrpn_Analog::print();
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "buttons of Panel: 1 0 0\nchannels of Panel: 0 -0.5\n");
}

TEST(VrpnLoopback, EachPrinterPrintsTheTextsOfItsDevices) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Text_Sender stick("Stick", connection.get());
  vrpn_Text_Sender other("Other", connection.get());
  FILE* const file = std::tmpfile();
  ASSERT_NE(file, nullptr);
  ::testing::internal::CaptureStdout();
  {
    vrpn_Text_Receiver second("Stick", connection.get());
    vrpn_TextPrinter printer;
    printer.set_ostream_to_use(file);
    printer.set_min_level_to_print(vrpn_TEXT_WARNING, 3);
    EXPECT_EQ(printer.add_object(nullptr), -1);
    EXPECT_EQ(printer.add_object(&stick), 0);
    EXPECT_EQ(printer.add_object(&stick), 0);
    EXPECT_EQ(printer.add_object(&second), 0);
    stick.send_message("a", vrpn_TEXT_NORMAL, 9);
    stick.send_message("b", vrpn_TEXT_WARNING, 2);
    stick.send_message("c", vrpn_TEXT_WARNING, 3);
    vrpn_System_TextPrinter.set_ostream_to_use(nullptr);
    stick.send_message("d", vrpn_TEXT_ERROR, 0);
    vrpn_System_TextPrinter.set_ostream_to_use(stdout);
    other.send_message("e", vrpn_TEXT_ERROR, 0);
    printer.remove_object(nullptr);
    printer.remove_object(&second);  // both are the device Stick
    stick.send_message("f", vrpn_TEXT_ERROR, 0);
    printer.add_object(&second);
  }
  vrpn_System_TextPrinter.remove_object(&other);
  other.send_message("g", vrpn_TEXT_ERROR, 0);
  vrpn_System_TextPrinter.add_object(&other);
  vrpn_System_TextPrinter.set_min_level_to_print(vrpn_TEXT_NORMAL);
  other.send_message("h\x1b[2J\n", vrpn_TEXT_NORMAL, 0);
  vrpn_System_TextPrinter.set_min_level_to_print(vrpn_TEXT_WARNING);
  std::fflush(stdout);
  EXPECT_EQ(::testing::internal::GetCapturedStdout(),
            "VRPN: warning of Stick: b\nVRPN: warning of Stick: c\nVRPN: error of Other: e\n"
            "VRPN: error of Stick: f\nVRPN: message of Other: h\xef\xbf\xbd[2J\xef\xbf\xbd\n")
      << "a terminal would obey";
  std::rewind(file);
  char text[200] = {};
  const std::size_t length = std::fread(text, 1, sizeof text, file);
  std::fclose(file);
  EXPECT_EQ(std::string(text, length), "VRPN: warning of Stick: c\nVRPN: error of Stick: d\n");
}

class Arm : public vrpn_ForceDevice_Remote {
 public:
  using vrpn_ForceDevice::decode_error;
  using vrpn_ForceDevice::decode_force;
  using vrpn_ForceDevice::decode_scp;
  using vrpn_ForceDevice::encode_error;
  using vrpn_ForceDevice::encode_force;
  using vrpn_ForceDevice_Remote::vrpn_ForceDevice_Remote;
};

TEST(VrpnLoopback, AForceDeviceShowsWhatItWasTold) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  Arm arm("Arm", connection.get());
  EXPECT_TRUE(arm.connectionAvailable());
  Payloads effects;
  connection->register_handler(connection->register_message_type("vrpn_ForceDevice Plane2"), Arrived::keep,
                               &effects);
  arm.setSurfaceKadhesionNormal(1);
  arm.setSurfaceKadhesionLateral(2);
  arm.setSurfaceTextureAmplitude(3);
  arm.setSurfaceTextureWavelength(4);
  arm.setSurfaceBuzzAmplitude(5);
  arm.setSurfaceBuzzFrequency(6);
  arm.setRecoveryTime(7);
  EXPECT_EQ(arm.getRecoveryTime(), 7);
  arm.sendSurface();
  EXPECT_EQ(effects,
            (Payloads{ofNumbers({0x3f800000, 0x40000000, 0x40400000, 0x40800000, 0x40a00000, 0x40c00000})}));
  vrpn_float32 plane[4] = {1, -2, 3, 0.5F};
  ::testing::internal::CaptureStdout();
  arm.set_plane(plane);
  arm.print_plane();
  arm.set_plane(plane, -4);
  arm.print_plane();
  vrpn_int32 length = 0;
  const vrpn_float64 newtons[3] = {1, -2, 0.5};
  const std::unique_ptr<char[]> force(Arm::encode_force(length, newtons));
  ASSERT_EQ(length, 24);
  const std::string bytes = ofNumbers({0x3ff00000, 0, 0xc0000000, 0, 0x3fe00000, 0});
  EXPECT_EQ(std::string(force.get(), 24), bytes);
  connection->pack_message(24, {1, 0}, connection->register_message_type("vrpn_ForceDevice Force"),
                           connection->register_sender("Arm"), force.get(), vrpn_CONNECTION_RELIABLE);
  arm.print_report();
  EXPECT_EQ(::testing::internal::GetCapturedStdout(),
            "plane of Arm: 1 -2 3 0.5\nplane of Arm: 1 -2 3 -4\n"
            "force of Arm: 1 -2 0.5 N; surface contact point: 0 0 0 m, quaternion 0 0 0 1\n");

  vrpn_float64 read[3] = {}, quaternion[4] = {};
  EXPECT_EQ(Arm::decode_force(bytes.data(), 24, read), 0);
  EXPECT_TRUE(std::equal(read, read + 3, newtons));
  const std::string pose = bytes + ofNumbers({0, 0, 0x3fe00000, 0, 0, 0, 0xbff00000, 0});
  EXPECT_EQ(Arm::decode_scp(pose.data(), 56, read, quaternion), 0);
  EXPECT_EQ(quaternion[1], 0.5);
  EXPECT_EQ(quaternion[3], -1);
  const std::unique_ptr<char[]> error(Arm::encode_error(length, FD_FORCE_ERROR));
  EXPECT_EQ(std::string(error.get(), static_cast<std::size_t>(length)), ofNumbers({2}));
  vrpn_int32 code = -1;
  EXPECT_EQ(Arm::decode_error(error.get(), 4, &code), 0);
  EXPECT_EQ(code, FD_FORCE_ERROR);
  for (const vrpn_int32 wrong : {-1, 0, 3, 5}) {
    EXPECT_EQ(Arm::decode_error(bytes.data(), wrong, &code), -1);
    EXPECT_EQ(Arm::decode_force(bytes.data(), wrong, read), -1);
    EXPECT_EQ(Arm::decode_scp(bytes.data(), wrong, read, quaternion), -1);
  }
}

TEST(VrpnLoopback, NewObjectsHaveNumbersThatNoOtherHas) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  Arm arm("Arm", connection.get());
  const vrpn_int32 first = arm.getNewObjectID();
  EXPECT_GT(first, 0) << "object 0 is the device's own";
  EXPECT_GT(arm.getNewObjectID(), first);
  arm.addObject(12);
  arm.addObjectExScene(10);
  EXPECT_EQ(arm.getNewObjectID(), 13);
  arm.addObjectExScene(14);
  EXPECT_EQ(arm.getNewObjectID(), 15);
}

TEST(VrpnLoopback, ACommandThatADeviceRefusesIsAnError) {
  class Refusing : public SpokenForceDevice {
    using SpokenForceDevice::SpokenForceDevice;
    bool addObject(vrpn_int32, vrpn_int32) override { return false; }
  };
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  Refusing device("Arm", connection.get());
  Arm arm("Arm", connection.get());
  vrpn_Text_Receiver texts("Arm", connection.get());
  std::vector<std::string> errors;
  texts.register_message_handler(&errors, [](void* list, const vrpn_TEXTCB text) {
    static_cast<std::vector<std::string>*>(list)->push_back(std::to_string(text.type) + text.message);
  });
  arm.addObject(1);
  EXPECT_EQ(errors, std::vector<std::string>{"2vrpn_ForceDevice addObject: refused by the device"});
}

TEST(VrpnLoopback, HandlersThatAreUnregisteredAreNotCalled) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  int calls = 0;
  const auto twice = [&](auto& remote, auto handler) {
    EXPECT_EQ(remote.register_change_handler(&calls, handler), 0);
    EXPECT_EQ(remote.unregister_change_handler(&calls, handler), 0);
    EXPECT_EQ(remote.unregister_change_handler(&calls, handler), -1);
  };
  vrpn_Tracker_Remote tracker("Device", connection.get());
  twice(
      tracker, +[](void*, const vrpn_TRACKERCB) {});
  twice(
      tracker, +[](void*, const vrpn_TRACKERVELCB) {});
  twice(
      tracker, +[](void*, const vrpn_TRACKERACCCB) {});
  twice(
      tracker, +[](void*, const vrpn_TRACKERUNIT2SENSORCB) {});
  twice(
      tracker, +[](void*, const vrpn_TRACKERTRACKER2ROOMCB) {});
  twice(
      tracker, +[](void*, const vrpn_TRACKERWORKSPACECB) {});
  vrpn_Analog_Remote analog("Device", connection.get());
  twice(
      analog, +[](void*, const vrpn_ANALOGCB) {});
  vrpn_Button_Remote button("Device", connection.get());
  twice(
      button, +[](void*, const vrpn_BUTTONCB) {});
  vrpn_Text_Receiver text("Device", connection.get());
  const auto count = [](void* number, const vrpn_TEXTCB) { ++*static_cast<int*>(number); };
  vrpn_Text_Sender sender("Device", connection.get());
  text.register_message_handler(&calls, count);
  sender.send_message("one");
  EXPECT_EQ(text.unregister_message_handler(&calls, count), 0);
  sender.send_message("two");
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(text.unregister_message_handler(&calls, count), -1);
}

TEST(VrpnLoopback, ARemoteOfTheSameProgramGetsTheStatesOfButtons) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Button_Server server("Buttons", connection.get(), 2);
  vrpn_Button_Remote remote("Buttons", connection.get());
  std::vector<vrpn_int32> states;
  remote.register_states_handler(&states, [](void* list, const vrpn_BUTTONSTATESCB report) {
    static_cast<std::vector<vrpn_int32>*>(list)->push_back(report.num_buttons);
  });
  for (int i = 0; i < 3; ++i) {
    server.mainloop();
    remote.mainloop();
  }
  EXPECT_EQ(states, std::vector<vrpn_int32>{2});
}

TEST(VrpnLoopback, ATextThatIsTooLongIsNotSent) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Text_Sender sender("Device", connection.get());
  vrpn_Text_Receiver receiver("Device", connection.get());
  std::vector<std::size_t> lengths;
  receiver.register_message_handler(&lengths, [](void* list, const vrpn_TEXTCB text) {
    static_cast<std::vector<std::size_t>*>(list)->push_back(std::strlen(text.message));
  });
  EXPECT_EQ(sender.send_message(std::string(vrpn_MAX_TEXT_LEN - 1, 'x').c_str()), 0);
  EXPECT_EQ(sender.send_message(std::string(vrpn_MAX_TEXT_LEN, 'x').c_str()), -1);
  EXPECT_EQ(lengths, std::vector<std::size_t>{vrpn_MAX_TEXT_LEN - 1});
}

// VRPN calls the handlers of a message in the order of their registration, those of any type first, and the
// handlers of a device in the opposite order.
TEST(VrpnLoopback, HandlersAreCalledInTheOrderOfVrpn) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  struct Call {
    std::string* calls;
    char name;
    static int VRPN_CALLBACK message(void* self, vrpn_HANDLERPARAM) {
      static_cast<Call*>(self)->calls->push_back(static_cast<Call*>(self)->name);
      return 0;
    }
    static void VRPN_CALLBACK pose(void* self, const vrpn_TRACKERCB) { message(self, {}); }
  };
  std::string calls;
  Call a{&calls, 'a'}, b{&calls, 'b'}, any{&calls, '*'};
  const vrpn_int32 type = connection->register_message_type("type");
  const vrpn_int32 sender = connection->register_sender("Device");
  connection->register_handler(type, Call::message, &a);
  connection->register_handler(type, Call::message, &b);
  connection->register_handler(vrpn_ANY_TYPE, Call::message, &any, sender);
  connection->pack_message(0, {}, type, sender, nullptr, vrpn_CONNECTION_RELIABLE);
  EXPECT_EQ(calls, "*ab");
  calls.clear();
  vrpn_Tracker_Server tracker("Tracker", connection.get());
  vrpn_Tracker_Remote remote("Tracker", connection.get());
  remote.register_change_handler(&a, Call::pose);
  remote.register_change_handler(&b, Call::pose);
  const vrpn_float64 position[3] = {};
  const vrpn_float64 turn[4] = {0, 0, 0, 1};
  tracker.report_pose(0, {1, 0}, position, turn);
  EXPECT_EQ(calls, "ba");
}

TEST(VrpnLoopback, ClippedChannelsAreMappedToUnits) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Clipping_Analog_Server analog("Stick", connection.get(), 1);
  EXPECT_EQ(analog.setClipValues(0, 0, 40, 60, 100), 0);
  EXPECT_EQ(analog.setClipValues(1, 0, 40, 60, 100), -1);
  EXPECT_EQ(analog.setClipValues(0, 50, 40, 60, 100), -1);
  const std::map<double, double> mapped{{-5, -1}, {0, -1}, {20, -0.5}, {50, 0}, {80, 0.5}, {200, 1}};
  for (const auto& [value, expected] : mapped) {
    analog.setChannelValue(0, value);
    EXPECT_EQ(analog.channels()[0], expected) << value;
  }
}

}  // namespace
}  // namespace hapticd

// Device programs written for VRPN's server classes, served by this library.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>
#include <vrpn_Analog.h>
#include <vrpn_Auxiliary_Logger.h>
#include <vrpn_Button.h>
#include <vrpn_Connection.h>
#include <vrpn_FileConnection.h>
#include <vrpn_FileController.h>
#include <vrpn_ForceDevice.h>
#include <vrpn_Forwarder.h>
#include <vrpn_ForwarderController.h>
#include <vrpn_LamportClock.h>
#include <vrpn_Mutex.h>
#include <vrpn_RedundantTransmission.h>
#include <vrpn_SharedObject.h>
#include <vrpn_Text.h>
#include <vrpn_Tracker.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/client_tests.h"
#include "client/vrpn_device.h"
#include "net/loopback.h"
#include "server/scripted_peer.h"
#include "wire/cookie.h"

namespace hapticd {
namespace {

using test::kPatience;
using test::ScriptedPeer;

struct Release {
  void operator()(vrpn_Connection* connection) const { connection->removeReference(); }
};
using ServedConnection = std::unique_ptr<vrpn_Connection, Release>;

// A device program on a port that the system chose, in this thread.
class VrpnServer : public ::testing::Test {
 protected:
  net::Endpoint address() const {
    return {net::kLoopbackAddress, static_cast<std::uint16_t>(connection_->servedPort())};
  }
  template <class Condition>
  bool runUntil(ScriptedPeer& peer, Condition&& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      program_->mainloop();
      peer.poll();
      vrpn_SleepMsecs(0.2);
    }
    return true;
  }

  ServedConnection connection_{vrpn_create_server_connection(0, nullptr, nullptr, "127.0.0.1")};
  std::unique_ptr<DeviceProgram> program_ = std::make_unique<DeviceProgram>(connection_.get());
};

std::vector<std::byte> contentsOf(const std::string& file) {
  std::ifstream in(HAPTICD_TESTDATA "/vrpn_server/" + file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  return {bytes, bytes + text.size()};
}

// What was said, by kind: texts up to their NUL, behind which is garbage; other payloads in hexadecimal
// digits.
using Said = std::map<std::string, std::vector<std::string>>;
void add(Said& said, wire::MessageKind kind, wire::ByteView payload) {
  std::string digits;
  for (const std::byte byte : payload) {
    for (const int shift : {4, 0}) digits += "0123456789abcdef"[std::to_integer<int>(byte) >> shift & 15];
  }
  said[std::string(wire::info(kind).name)].push_back(digits);
}
void add(Said& said, const wire::Text& text) {
  said[std::string(wire::Text::kInfo.name)].push_back(std::to_string(text.severity) + ' ' +
                                                      std::to_string(text.level) + ' ' + text.text.text);
}

// A client of VRPN 07.38 uses everything that the device offers. The answers are those of the same program
// linked with VRPN.
TEST_F(VrpnServer, AnswersARecordedClientAsVrpnDoes) {
  Said expected;
  std::size_t count = 0;
  {
    wire::LocalNames names;
    names.addSender("Device0");
    wire::Peer reader(names);
    reader.feed({}, contentsOf("server.bin"), [&](const wire::Event& event) {
      const auto* message = std::get_if<wire::MessageReceived>(&event);
      if (message == nullptr || message->local_sender.value != 0) return;
      ++count;
      if (message->kind == wire::kindOf<wire::Text>) {
        add(expected, *wire::decode<wire::Text>(message->payload));
      } else {
        add(expected, message->kind, message->payload);
      }
    });
  }
  ASSERT_GE(count, 60U);
  ScriptedPeer client(address(), "Device0", ScriptedPeer::Mode::tcp, ScriptedPeer::Speech::raw);
  client.sendBytes(contentsOf("client.bin"));
  const auto received = [&] { return client.messages().size() + client.texts().size(); };
  EXPECT_TRUE(runUntil(client, [&] { return received() >= count; })) << received() << " of " << count;
  Said answered;
  for (const auto& message : client.messages()) {
    if (message.kind != wire::kindOf<wire::Text>) add(answered, message.kind, message.payload);
  }
  for (const wire::Text& text : client.texts()) add(answered, text);
  // VRPN's handler passes stiffness, dynamic friction, static friction and damping in this order, although
  // the function declares stiffness, damping, dynamic friction and static friction. Ours passes them as
  // declared.
  auto& texts = answered[std::string(wire::Text::kInfo.name)];
  const auto declared =
      std::find(texts.begin(), texts.end(), "0 0 updateTrimeshChanges 1 0.5 0.25 0.125 0.75");
  ASSERT_NE(declared, texts.end());
  *declared = "0 0 updateTrimeshChanges 1 0.5 0.125 0.75 0.25";
  for (const auto& [kind, messages] : expected) EXPECT_EQ(answered[kind], messages) << kind;
  EXPECT_EQ(answered.size(), expected.size());
}

TEST_F(VrpnServer, SendsLowLatencyReportsByDatagram) {
  ScriptedPeer client(address(), "Device0", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ButtonStates>() > 0; }));
  client.send(wire::Ping{});
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::Pong>() > 0; }));
  client.send(wire::TrackerResetOrigin{});
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ForceError>() > 0; }));
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::Force>() > 0; }));
  EXPECT_GT(client.datagrams(), 0U);
  EXPECT_EQ(client.all<wire::TrackerVelocity>().at(0).interval, 0.25);
  for (const auto& message : client.messages()) {
    EXPECT_FALSE(message.kind == wire::kindOf<wire::ButtonChange> && message.byDatagram);
  }
}

TEST_F(VrpnServer, SendsByTcpToAClientThatDescribesAnotherMachinesUdpPort) {
  ScriptedPeer client(address(), "Device0", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ButtonStates>() > 0; }));
  const auto askForForce = [&] {
    client.forget();
    client.send(wire::TrackerResetOrigin{});
    return runUntil(client, [&] { return client.count<wire::Force>() > 0; });
  };
  const auto byDatagram = [&] {
    const auto& all = client.messages();
    return std::find_if(all.begin(), all.end(),
                        [](const auto& message) { return message.kind == wire::kindOf<wire::Force>; })
        ->byDatagram;
  };
  ASSERT_TRUE(askForForce());
  EXPECT_TRUE(byDatagram());
  wire::FrameEncoder description;
  description.addRaw({1, 2}, 9, wire::kUdpDescription, wire::encodeUdpDescription({"127.0.0.99", 9}));
  client.sendBytes(description.bytes());
  ASSERT_TRUE(askForForce());
  EXPECT_FALSE(byDatagram());
}

// Each reset is answered by one error of the force device.
TEST_F(VrpnServer, ADatagramOfAnotherMachineIsIgnored) {
  ScriptedPeer client(address(), "Device0", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ButtonStates>() > 0; }));
  client.send(wire::Ping{});  // by TCP, behind the names
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::Pong>() > 0; }));
  wire::FrameEncoder reset;
  reset.addRaw({1, 2}, 1, wire::kLocalType<wire::TrackerResetOrigin>.value, {});
  auto stranger = net::RawSocket::connectedFrom(2, client.udpPeer(), SOCK_DGRAM);
  ASSERT_TRUE(stranger.send({reinterpret_cast<const char*>(reset.bytes().data()), reset.bytes().size()}));
  client.sendDatagram(reset.bytes());
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ForceError>() > 0; }));
  client.send(wire::Ping{});
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::Pong>() > 1; }));
  EXPECT_EQ(client.count<wire::ForceError>(), 1U);
}

// The table of names is one for all clients, and has room for 2000.
TEST_F(VrpnServer, AClientThatDescribesVeryManyTypesHarmsNobody) {
  ScriptedPeer greedy(address(), "Device0");
  ScriptedPeer other(address(), "Device0");
  ASSERT_TRUE(runUntil(greedy, [&] { return greedy.count<wire::ButtonStates>() > 0; }));
  ASSERT_TRUE(runUntil(other, [&] { return other.count<wire::ButtonStates>() > 0; }));
  for (int i = 0; i < 1500; ++i) greedy.sendForeign("type " + std::to_string(i), {});
  greedy.send(wire::Ping{});
  ASSERT_TRUE(runUntil(greedy, [&] { return greedy.count<wire::Pong>() > 0; }));
  for (int i = 0; i < 1500; ++i) other.sendForeign("another type " + std::to_string(i), {});
  other.send(wire::Ping{});
  EXPECT_TRUE(runUntil(other, [&] { return other.count<wire::Pong>() > 0; }));
  EXPECT_TRUE(other.open()) << other.closeReason();
  EXPECT_GE(connection_->register_message_type("a type of the program"), 0);
}

TEST_F(VrpnServer, ReportsConnectionsToItsHandlers) {
  struct Seen {
    int firsts = 0, connections = 0, drops = 0, lasts = 0;
    static int VRPN_CALLBACK count(void* number, vrpn_HANDLERPARAM) {
      ++*static_cast<int*>(number);
      return 0;
    }
  } seen;
  const auto on = [&](const char* type, int* number) {
    connection_->register_handler(connection_->register_message_type(type), Seen::count, number);
  };
  on(vrpn_got_first_connection, &seen.firsts);
  on(vrpn_got_connection, &seen.connections);
  on(vrpn_dropped_connection, &seen.drops);
  on(vrpn_dropped_last_connection, &seen.lasts);
  auto one = std::make_unique<ScriptedPeer>(address(), "Device0");
  auto two = std::make_unique<ScriptedPeer>(address(), "Device0");
  ASSERT_TRUE(runUntil(*one, [&] {
    two->poll();
    return seen.connections == 2;
  }));
  EXPECT_EQ(seen.firsts, 1);
  EXPECT_TRUE(connection_->connected());
  one.reset();
  ASSERT_TRUE(runUntil(*two, [&] { return seen.drops == 1; }));
  EXPECT_EQ(seen.lasts, 0);
  two->close();
  ASSERT_TRUE(runUntil(*two, [&] { return seen.drops == 2; }));
  EXPECT_EQ(seen.lasts, 1);
  EXPECT_FALSE(connection_->connected());
}

// Programs index arrays of vrpn_CONNECTION_MAX_TYPES by them.
TEST_F(VrpnServer, NumbersOfTypesAreBelowTheirLimit) {
  std::vector<vrpn_int32> types;
  connection_->register_handler(
      vrpn_ANY_TYPE,
      [](void* list, vrpn_HANDLERPARAM p) {
        static_cast<std::vector<vrpn_int32>*>(list)->push_back(p.type);
        return 0;
      },
      &types, connection_->register_sender(vrpn_CONTROL));
  ScriptedPeer client(address(), "Device0");
  ASSERT_TRUE(runUntil(client, [&] { return connection_->connected(); }));
  ASSERT_EQ(types.size(), 2U);
  EXPECT_STREQ(connection_->message_type_name(types[0]), vrpn_got_first_connection);
  EXPECT_STREQ(connection_->message_type_name(types[1]), vrpn_got_connection);
  for (const vrpn_int32 type : types) EXPECT_LT(type, vrpn_CONNECTION_MAX_TYPES);
  vrpn_int32 largest = 0;
  for (int i = 0; i < vrpn_CONNECTION_MAX_TYPES; ++i) {
    largest = std::max(largest, connection_->register_message_type(std::to_string(i).c_str()));
  }
  EXPECT_LT(largest, types[0]) << "no other type has the number";
}

TEST_F(VrpnServer, ADamagedStreamEndsOnlyItsConnection) {
  ScriptedPeer good(address(), "Device0");
  ScriptedPeer bad(address(), "Device0", ScriptedPeer::Mode::tcp, ScriptedPeer::Speech::raw);
  bad.sendBytes(std::vector<std::byte>(100, std::byte{0xff}));
  ASSERT_TRUE(runUntil(good, [&] {
    bad.poll();
    return !bad.open();
  }));
  ASSERT_TRUE(runUntil(good, [&] { return good.count<wire::ButtonStates>() > 0; }));
}

TEST_F(VrpnServer, AClientWhoseStreamIsDamagedIsReportedAsDropped) {
  int dropped = 0;
  connection_->register_handler(
      connection_->register_message_type(vrpn_dropped_last_connection),
      [](void* count, vrpn_HANDLERPARAM) { return ++*static_cast<int*>(count), 0; }, &dropped);
  ScriptedPeer bad(address(), "Device0", ScriptedPeer::Mode::tcp, ScriptedPeer::Speech::raw);
  const auto cookie = wire::encodeCookie(0);
  std::vector<std::byte> bytes(cookie.begin(), cookie.end());
  bytes.resize(bytes.size() + 100, std::byte{0xff});
  bad.sendBytes(bytes);
  ASSERT_TRUE(runUntil(bad, [&] { return !bad.open(); }));
  ASSERT_TRUE(runUntil(bad, [&] { return dropped == 1; }));
  EXPECT_FALSE(connection_->connected());
}

TEST_F(VrpnServer, APortThatIsTakenIsReported) {
  EXPECT_EQ(vrpn_create_server_connection(connection_->servedPort(), nullptr, nullptr, "127.0.0.1"), nullptr);
}

TEST_F(VrpnServer, APortIsServedByTheNameOfItsAddress) {
  const std::string name = "Device0@127.0.0.1:" + std::to_string(connection_->servedPort());
  EXPECT_EQ(vrpn_create_server_connection(name.c_str()), nullptr) << "it is taken";
  const int port = connection_->servedPort();
  program_.reset();
  connection_.reset();
  timeval before, opened, after;
  vrpn_gettimeofday(&before);
  connection_.reset(vrpn_create_server_connection(name.c_str()));
  ASSERT_TRUE(connection_);
  EXPECT_EQ(connection_->servedPort(), port);
  EXPECT_EQ(connection_->time_since_connection_open(&opened), 0);
  vrpn_gettimeofday(&after);
  EXPECT_GE(vrpn_TimevalMsecs(opened), 0);
  EXPECT_LE(vrpn_TimevalMsecs(opened), vrpn_TimevalMsecs(vrpn_TimevalDiff(after, before)));
  EXPECT_EQ(vrpn_create_server_connection(static_cast<const char*>(nullptr)), nullptr);
}

TEST_F(VrpnServer, ProgramsMayCreateTheirConnectionThemselves) {
  vrpn_Connection_IP connection(0, nullptr, nullptr, "127.0.0.1");
  EXPECT_TRUE(connection.doing_okay());
  EXPECT_NE(connection.servedPort(), 0);
  vrpn_Connection_IP second(static_cast<unsigned short>(connection.servedPort()), nullptr, nullptr,
                            "127.0.0.1");
  EXPECT_FALSE(second.doing_okay()) << "the port is taken";
  EXPECT_EQ(second.mainloop(), -1);
}

TEST_F(VrpnServer, AHandlerOfAMessageOfTheProgramItselfMayEndTheConnection) {
  const int port = connection_->servedPort();
  vrpn_Connection* connection = connection_.get();
  program_.reset();
  const vrpn_int32 type = connection->register_message_type("the end");
  connection->register_handler(
      type,
      [](void* reference, vrpn_HANDLERPARAM) {
        static_cast<ServedConnection*>(reference)->reset();
        return 0;
      },
      &connection_);
  connection->pack_message(0, {}, type, connection->register_sender("program"), nullptr,
                           vrpn_CONNECTION_RELIABLE);
  EXPECT_FALSE(connection->doing_okay());
  const ServedConnection again(vrpn_create_server_connection(port, nullptr, nullptr, "127.0.0.1"));
  EXPECT_TRUE(again) << "the port is free again";
}

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

// Keeps payloads as they arrive.
struct Arrived {
  static int VRPN_CALLBACK keep(void* list, vrpn_HANDLERPARAM p) {
    static_cast<std::vector<std::string>*>(list)->emplace_back(p.buffer,
                                                               static_cast<std::size_t>(p.payload_len));
    return 0;
  }
};
using Payloads = std::vector<std::string>;

std::string ofNumbers(std::initializer_list<std::uint32_t> numbers) {
  std::string bytes;
  for (const std::uint32_t number : numbers) {
    for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(number >> shift);
  }
  return bytes;
}

// As if its last client were gone, or another had come.
void tellOf(vrpn_Connection& connection, const char* what) {
  connection.pack_message(0, {}, connection.register_message_type(what),
                          connection.register_sender(vrpn_CONTROL), nullptr, vrpn_CONNECTION_RELIABLE);
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

// The conversation of a lock, on both sides in one program.
TEST(VrpnLoopback, ALockIsGrantedToOneAtATime) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  const auto count = [](void* number) { return ++*static_cast<int*>(number); };
  vrpn_Mutex_Server server("Lock", connection.get());
  vrpn_Mutex_Remote one("Lock", connection.get());
  vrpn_Mutex_Remote two("Lock", connection.get());
  // No client connects to a loopback, so the remotes ask when they are told.
  const vrpn_int32 connected = connection->register_message_type(vrpn_got_connection);
  connection->pack_message(0, {}, connected, connection->register_sender(vrpn_CONTROL), nullptr,
                           vrpn_CONNECTION_RELIABLE);
  int granted = 0;
  int denied = 0;
  one.addRequestGrantedCallback(&granted, count);
  two.addRequestDeniedCallback(&denied, count);
  EXPECT_TRUE(one.isAvailable());
  one.request();
  EXPECT_EQ(granted, 1);
  EXPECT_TRUE(one.isHeldLocally());
  EXPECT_TRUE(two.isHeldRemotely());
  two.request();
  EXPECT_EQ(denied, 1);
  two.release();
  EXPECT_TRUE(one.isHeldLocally()) << "only its holder releases it";
  one.release();
  EXPECT_TRUE(two.isAvailable());
  two.request();
  EXPECT_TRUE(two.isHeldLocally());
  EXPECT_TRUE(one.isHeldRemotely());
}

// The lock's owner goes away.
TEST(VrpnLoopback, ALockIsFreedByItsEnd) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Mutex_Server server("Lock", connection.get());
  vrpn_Mutex_Remote two("Lock", connection.get());
  {
    vrpn_Mutex_Remote one("Lock", connection.get());
    one.request();
    EXPECT_TRUE(two.isHeldRemotely());
  }
  EXPECT_TRUE(two.isAvailable());
  two.request();
  ASSERT_TRUE(two.isHeldLocally());
  int denied = 0;
  vrpn_Mutex_Remote three("Lock", connection.get());
  three.addRequestDeniedCallback(&denied, [](void* number) { return ++*static_cast<int*>(number); });
  EXPECT_TRUE(three.isAvailable()) << "it has not heard of the grant";
  three.request();
  EXPECT_TRUE(three.isHeldRemotely());
  EXPECT_EQ(denied, 1);
  tellOf(*connection, vrpn_dropped_last_connection);
  vrpn_Mutex_Remote four("Lock", connection.get());
  four.request();
  EXPECT_TRUE(four.isHeldLocally()) << "the server freed it";
}

TEST(VrpnLoopback, ALockIsAskedForWhenItsServerIsThere) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Mutex_Remote lock("Lock", connection.get());
  lock.request();
  const vrpn_Mutex_Server server("Lock", connection.get());
  tellOf(*connection, vrpn_dropped_connection);
  EXPECT_FALSE(lock.isHeldLocally());
  tellOf(*connection, vrpn_got_connection);
  EXPECT_TRUE(lock.isHeldLocally());
}

TEST(VrpnLoopback, ForwardsUnderOtherNamesAndTakesRepetitionsOnce) {
  const ServedConnection from(vrpn_create_server_connection("loopback:"));
  const ServedConnection to(vrpn_create_server_connection("loopback:"));
  vrpn_StreamForwarder forwarder(from.get(), "Device", to.get(), "Copy");
  ASSERT_EQ(forwarder.forward("Sign", "Signal"), 0);
  std::vector<std::string> all;
  std::vector<std::string> once;
  const vrpn_int32 signal = to->register_message_type("Signal");
  to->register_handler(signal, Arrived::keep, &all, to->register_sender("Copy"));
  vrpn_RedundantReceiver receiver(to.get());
  receiver.register_handler(signal, Arrived::keep, &once);
  vrpn_RedundantTransmission redundant(from.get());
  redundant.enable(vrpn_true);
  const vrpn_int32 type = from->register_message_type("Sign");
  const vrpn_int32 sender = from->register_sender("Device");
  const auto send = [&](const char* text, long second, int repeats) {
    timeval interval = {0, 0};
    redundant.pack_message(1, {second, 0}, static_cast<vrpn_uint32>(type), static_cast<vrpn_uint32>(sender),
                           text, vrpn_CONNECTION_RELIABLE, repeats, &interval);
  };
  send("a", 1, 2);
  send("b", 2, 0);
  EXPECT_EQ(all, (std::vector<std::string>{"a", "a", "a", "b"}));
  EXPECT_EQ(once, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(forwarder.unforward("Sign", "Signal"), 0);
  EXPECT_EQ(forwarder.unforward("Sign", "Signal"), -1);
  send("c", 3, 0);
  EXPECT_EQ(all.size(), 4U);
}

TEST(VrpnLoopback, RepetitionsAreSentWhenTheyAreDue) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  Payloads all, once;
  const vrpn_int32 type = connection->register_message_type("Sign");
  connection->register_handler(type, Arrived::keep, &all);
  vrpn_RedundantReceiver receiver(connection.get());
  receiver.register_handler(type, Arrived::keep, &once);
  vrpn_RedundantTransmission redundant(connection.get());
  const auto send = [&](const char* text, long second, int repeats, timeval interval) {
    return redundant.pack_message(1, {second, 0}, static_cast<vrpn_uint32>(type), 0, text,
                                  vrpn_CONNECTION_RELIABLE, repeats, &interval);
  };
  EXPECT_EQ(send("a", 1, 3, {0, 0}), 0);
  EXPECT_EQ(all, Payloads{"a"}) << "it is not enabled";
  redundant.enable(vrpn_true);
  send("b", 2, 2, {0, 1000});
  send("c", 3, 1, {1000, 0});
  redundant.mainloop();
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (all.size() < 5 && std::chrono::steady_clock::now() < end) redundant.mainloop();
  vrpn_SleepMsecs(3);
  redundant.mainloop();
  std::sort(all.begin(), all.end());
  EXPECT_EQ(all, (Payloads{"a", "b", "b", "b", "c"})) << "c is not due";
  EXPECT_EQ(once, (Payloads{"a", "b", "c"}));
  EXPECT_EQ(receiver.unregister_handler(type, Arrived::keep, &all), -1);
  EXPECT_EQ(receiver.unregister_handler(type, Arrived::keep, &once), 0);
  EXPECT_EQ(receiver.unregister_handler(type, Arrived::keep, &once), -1);
  send("d", 4, 0, {0, 0});
  EXPECT_EQ(once.size(), 3U);
  vrpn_RedundantTransmission nowhere(nullptr);
  nowhere.mainloop();
  EXPECT_EQ(nowhere.pack_message(1, {}, 0, 0, "x", vrpn_CONNECTION_RELIABLE), -1);
}

TEST(VrpnLoopback, ARemoteSetsHowOftenMessagesAreRepeated) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_RedundantTransmission redundant(connection.get());
  const vrpn_RedundantController controller(&redundant, connection.get());
  vrpn_RedundantRemote remote(connection.get());
  remote.set(2, {0, 1500});
  remote.enable(vrpn_true);
  EXPECT_EQ(redundant.defaultRetransmissions(), 2U);
  EXPECT_EQ(redundant.defaultInterval().tv_usec, 1500);
  EXPECT_TRUE(redundant.isEnabled());
  vrpn_RedundantReceiver receiver(connection.get());
  std::vector<std::string> once;
  const vrpn_int32 type = connection->register_message_type("Sign");
  receiver.register_handler(type, Arrived::keep, &once);
  receiver.record(vrpn_true);
  timeval interval = {0, 0};
  redundant.pack_message(1, {7, 8}, static_cast<vrpn_uint32>(type), 0, "a", vrpn_CONNECTION_RELIABLE, 2,
                         &interval);
  const std::string path =
      std::filesystem::temp_directory_path() / ("vrpn_memory_" + std::to_string(getpid()));
  receiver.writeMemory((path + "/x").c_str());  // no such directory
  receiver.writeMemory(path.c_str());
  const auto written = [&] {
    std::ifstream in(path);
    return std::string{std::istreambuf_iterator<char>(in), {}};
  };
  EXPECT_EQ(written(), "7.8 3\n");
  receiver.clearMemory();
  receiver.writeMemory(path.c_str());
  EXPECT_EQ(written(), "");
  std::remove(path.c_str());
  EXPECT_EQ(once.size(), 1U);
}

// The names and bytes that VRPN 07.38 sends, and what is made of them.
TEST(VrpnLoopback, AClientHasMessagesForwardedToAnotherPort) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  std::vector<std::string> requests;
  connection->register_handler(connection->register_message_type("vrpn_Forwarder_Brain forward"),
                               Arrived::keep, &requests, connection->register_sender("vrpn_Forwarder_Brain"));
  vrpn_Forwarder_Server server(connection.get());
  vrpn_Forwarder_Controller controller(connection.get());
  EXPECT_TRUE(controller.start_remote_forwarding(0));  // the system chooses the port
  ASSERT_NE(server.connectionAt(0), nullptr);
  EXPECT_FALSE(server.start_remote_forwarding(0)) << "it is open";
  controller.forward_message_type(0, "Device", "Sign");
  EXPECT_EQ(requests, (std::vector<std::string>{std::string("\0\0\0\0\0\0\0\6\0\0\0\4", 12) + "DeviceSign"}));
  std::vector<std::string> forwarded;
  vrpn_Connection* const other = server.connectionAt(0);
  other->register_handler(other->register_message_type("Sign"), Arrived::keep, &forwarded,
                          other->register_sender("Device"));
  const auto send = [&](const std::string& type, const std::string& from, const std::string& payload) {
    connection->pack_message(
        static_cast<vrpn_uint32>(payload.size()), {1, 0}, connection->register_message_type(type.c_str()),
        connection->register_sender(from.c_str()), payload.data(), vrpn_CONNECTION_RELIABLE);
  };
  send("Sign", "Device", "a");
  send("Sign", "Other", "b");
  send("vrpn_Forwarder_Brain forward", "vrpn_Forwarder_Brain",
       std::string("\0\0\0\0\x7f\xff\xff\xff\0\0\0\4", 12) + "DeviceSign");
  EXPECT_EQ(forwarded, std::vector<std::string>{"a"});
  server.mainloop();
}

struct SharedPair {
  ServedConnection connection{vrpn_create_server_connection("loopback:")};
  std::vector<std::string> updates;
  vrpn_Shared_int32_Server server;
  vrpn_Shared_int32_Remote remote;

  explicit SharedPair(vrpn_int32 mode) : server("a", 0, mode), remote("a", 0, mode) {
    connection->register_handler(connection->register_message_type("vrpn_Shared update"), Arrived::keep,
                                 &updates);
    server.bindConnection(connection.get());
    remote.bindConnection(connection.get());
  }
};

TEST(VrpnLoopback, ANumberIsShared) {
  SharedPair pair(VRPN_SO_DEFAULT);
  std::vector<std::pair<vrpn_int32, bool>> seen;
  pair.remote.register_handler(
      +[](void* list, vrpn_int32 value, vrpn_bool local) {
        static_cast<std::vector<std::pair<vrpn_int32, bool>>*>(list)->emplace_back(value, local != 0);
        return 0;
      },
      &seen);
  pair.server.set(3, {5, 6});
  EXPECT_EQ(pair.remote, 3);
  pair.remote = -4;
  EXPECT_EQ(pair.server, -4);
  EXPECT_EQ(seen, (std::vector<std::pair<vrpn_int32, bool>>{{3, false}, {-4, true}}));
  EXPECT_EQ(pair.updates.at(0), std::string("\0\0\0\3\0\0\0\5\0\0\0\6", 12));
  EXPECT_EQ(pair.updates.size(), 2U);
}

TEST(VrpnLoopback, ASharedNumberIsBoundOnce) {
  SharedPair pair(VRPN_SO_DEFAULT);
  EXPECT_STREQ(pair.server.name(), "a");
  const ServedConnection other(vrpn_create_server_connection("loopback:"));
  pair.remote.bindConnection(other.get());
  vrpn_Shared_int32& number = pair.remote;
  EXPECT_EQ(&(number = 6), &number);
  EXPECT_EQ(pair.server, 6) << "over the first connection";
}

TEST(VrpnLoopback, TheSerializerDecidesWhichValuesCount) {
  SharedPair pair(VRPN_SO_DEFER_UPDATES);
  EXPECT_TRUE(pair.server.isSerializer());
  pair.remote = 7;
  EXPECT_EQ(pair.server, 7);
  EXPECT_EQ(pair.remote, 7) << "the serializer sends it back";
  pair.server.setSerializerPolicy(vrpn_DENY_REMOTE);
  int deferred = 0;
  pair.remote.registerDeferredUpdateCallback(
      +[](void* count) {
        ++*static_cast<int*>(count);
        return 0;
      },
      &deferred);
  pair.remote = 8;
  EXPECT_EQ(pair.remote, 7);
  EXPECT_EQ(deferred, 1);
  pair.remote.becomeSerializer();
  EXPECT_TRUE(pair.remote.isSerializer());
  EXPECT_FALSE(pair.server.isSerializer());
  pair.remote = 9;
  EXPECT_EQ(pair.server, 9);
  pair.server = 10;
  EXPECT_EQ(pair.server, 10) << "accepted by the new serializer, which has no policy against it";
}

TEST(VrpnLoopback, TextsAndFloatsAreShared) {
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  vrpn_Shared_String_Server server("b", "first", VRPN_SO_IGNORE_OLD);
  vrpn_Shared_String_Remote remote("b", nullptr, VRPN_SO_IGNORE_OLD);
  server.bindConnection(connection.get());
  remote.bindConnection(connection.get());
  EXPECT_STREQ(remote.value(), "");
  server.set("a longer text", {2'000'000'000, 0});
  EXPECT_STREQ(remote.value(), "a longer text");
  server.set("older", {1'900'000'000, 0});
  EXPECT_STREQ(remote.value(), "a longer text");
  vrpn_Shared_float64_Server height("c", 1.5);
  vrpn_Shared_float64_Remote seen("c");
  height.bindConnection(connection.get());
  seen.bindConnection(connection.get());
  height = -2.25;
  EXPECT_EQ(seen, -2.25);
  seen.bindConnection(nullptr);
  height = 1;
  EXPECT_EQ(seen, -2.25);
}

TEST(VrpnLoopback, ARequestToLogIsAnswered) {
  class Logger : public vrpn_Auxiliary_Logger_Server {
   public:
    explicit Logger(vrpn_Connection* connection) : vrpn_Auxiliary_Logger_Server("Logger", connection) {}

   private:
    void handle_request_logging(const char* in, const char* out, const char* far_in,
                                const char* far_out) override {
      send_report_logging(in, out, far_in, far_out);
    }
    void handle_request_logging_status() override { send_report_logging("", "", "", "none"); }
  };
  const ServedConnection connection(vrpn_create_server_connection("loopback:"));
  Logger logger(connection.get());
  vrpn_Auxiliary_Logger_Remote remote("Logger", connection.get());
  std::vector<std::string> reports;
  remote.register_report_handler(&reports, [](void* list, const vrpn_AUXLOGGERCB r) {
    std::string report;
    for (const char* file : {r.local_in_logfile_name, r.local_out_logfile_name, r.remote_in_logfile_name,
                             r.remote_out_logfile_name}) {
      report += file != nullptr ? std::string(file) + ',' : "NULL,";
    }
    static_cast<std::vector<std::string>*>(list)->push_back(report);
  });
  EXPECT_TRUE(remote.send_logging_request("a", "", "bc", nullptr));
  EXPECT_TRUE(remote.send_logging_status_request());
  EXPECT_EQ(reports, (std::vector<std::string>{"a,NULL,bc,NULL,", "NULL,NULL,NULL,none,"}));
  tellOf(*connection, vrpn_dropped_last_connection);
  ASSERT_EQ(reports.size(), 3U);
  EXPECT_EQ(reports[2], "NULL,NULL,NULL,NULL,") << "logging ends with the last client";
}

TEST(VrpnLoopback, StampsOfSeveralHostsAreOrdered) {
  vrpn_LamportClock one(2, 0);
  vrpn_LamportClock two(2, 1);
  const std::unique_ptr<vrpn_LamportTimestamp> first(one.getTimestampAndAdvance());
  const std::unique_ptr<vrpn_LamportTimestamp> beside(two.getTimestampAndAdvance());
  EXPECT_FALSE(*first < *beside);
  EXPECT_FALSE(*beside < *first);
  two.receive(*first);
  const std::unique_ptr<vrpn_LamportTimestamp> after(two.getTimestampAndAdvance());
  EXPECT_TRUE(*first < *after);
  EXPECT_TRUE(*beside < *after);
}

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

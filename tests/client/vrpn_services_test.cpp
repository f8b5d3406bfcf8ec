// VRPN's locks, forwarders, shared values and loggers, both sides in one program.
#include <gtest/gtest.h>
#include <unistd.h>
#include <vrpn_Auxiliary_Logger.h>
#include <vrpn_Connection.h>
#include <vrpn_Forwarder.h>
#include <vrpn_ForwarderController.h>
#include <vrpn_LamportClock.h>
#include <vrpn_Mutex.h>
#include <vrpn_RedundantTransmission.h>
#include <vrpn_SharedObject.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "client/client_tests.h"
#include "client/vrpn_both_sides.h"
#include "net/loopback.h"

namespace hapticd {
namespace {

using test::Arrived;
using test::kPatience;
using test::Payloads;
using test::ServedConnection;
using test::tellOf;

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

}  // namespace
}  // namespace hapticd

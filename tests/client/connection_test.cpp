// Connecting, losing a connection, and the texts of errors.
#include "client/client_tests.h"

#include <time.h>

#include <atomic>
#include <cerrno>
#include <semaphore>
#include <system_error>
#include <thread>

#include "net/loop_impl.h"
#include "net/network.h"
#include "wire/cookie.h"
#include "wire/udp_request.h"

namespace hapticd::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

INSTANTIATE_TEST_SUITE_P(Connection, BothWays, ::testing::Bool(),
                         [](const auto& way) { return way.param ? "tcp" : "callback"; });

TEST_P(BothWays, ConnectsAndIsAnswered) {
  ScriptedServer server;
  const Client client(name(server));
  EXPECT_TRUE(client.connected());
  EXPECT_EQ(client.device(), "Phantom");
  EXPECT_EQ(client.server(), "127.0.0.1:" + std::to_string(server.port()));
  EXPECT_EQ(server.connections(), 1U);
  EXPECT_GE(server.pings(), 1U);
  EXPECT_EQ(client.statistics().connections, 1U);
}

TEST_P(BothWays, AClientThatIsReplacedLeavesItsServer) {
  ScriptedServer first;
  ScriptedServer second;
  Client client(name(first));
  client = Client(name(second));
  EXPECT_TRUE(client.connected());
  EXPECT_EQ(client.server(), "127.0.0.1:" + std::to_string(second.port()));
  EXPECT_TRUE(pollUntil(client, [&] { return first.openConnections() == 0; }));
  client.startEffect(7);
  client.flushAll();
  const auto received = second.waitReceived(1);
  ASSERT_EQ(received.size(), 1U);
  EXPECT_TRUE(is(received[0], wire::StartEffect{7}));
}

TEST_P(BothWays, ReconnectsWhenTheServerIsBack) {
  auto server = std::make_unique<ScriptedServer>();
  const std::uint16_t port = server->port();
  Client client(name(*server));
  std::vector<bool> states;
  std::string reason;
  client.onConnection([&](const ConnectionReport& r) {
    states.push_back(r.connected);
    if (!r.connected) reason = r.reason;
  });
  client.poll(0ms);
  server->send(wire::TouchedObject{5});
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().touchedObject.object == 5; }));
  server.reset();
  ASSERT_TRUE(pollUntil(client, [&] { return !client.connected(); }));
  ASSERT_TRUE(pollUntil(client, [&] { return !states.empty() && !states.back(); }));
  EXPECT_EQ(client.latest().touchedObject.object, -1) << "reset with the connection";
  EXPECT_FALSE(reason.empty());
  client.startEffect(1);
  EXPECT_EQ(client.statistics().messagesDropped, 1U);

  server = std::make_unique<ScriptedServer>(ScriptedServerOptions{.port = port});
  ASSERT_TRUE(pollUntil(client, [&] { return client.connected() && states.back(); }));
  client.startEffect(2);
  client.flush();
  const auto received = server->waitReceived(1);
  ASSERT_EQ(received.size(), 1U) << "a command without a connection is dropped";
  EXPECT_TRUE(is(received[0], wire::StartEffect{2}));
  EXPECT_EQ(received[0].sender, "Phantom") << "names are described again";
  EXPECT_EQ(client.statistics().connections, 2U);
}

TEST_P(BothWays, SafetyCallsThatReachNobodyThrowAlsoWithoutAPollBefore) {
  const auto stop = [](Client& client) { client.stopForces(); };
  const auto mark = [](Client& client) { client.mark("trial 3 begins"); };
  const auto rearm = [](Client& client) { client.rearmForces(); };
  const std::pair<const char*, void (*)(Client&)> calls[] = {
      {"forces not stopped", stop}, {"not marked", mark}, {"forces not re-armed", rearm}};
  for (const auto& [failure, call] : calls) {
    ScriptedServer server({.capabilities = allCapabilities()});
    Client client(name(server));
    ASSERT_TRUE(client.waitCapabilities());
    call(client);
    server.dropClients();
    const std::string text = textOf<ConnectionLost>([&] { call(client); });
    EXPECT_THAT(text, HasSubstr(failure));
    EXPECT_THAT(text, HasSubstr("by the peer"));
  }
}

TEST(Client, DoesNotReconnectWhenDisabled) {
  ScriptedServer server;
  Client client(server.tcpName(), {.reconnect = false});
  server.dropClients();
  ASSERT_TRUE(pollUntil(client, [&] { return !client.connected(); }));
  client.poll(600ms);  // more than twice the pause between attempts
  EXPECT_FALSE(client.connected());
  EXPECT_EQ(server.connections(), 1U);
}

TEST(Client, SleepsWhileNothingHappens) {
  ScriptedServer server;
  Client client(server.tcpName());
  while (client.poll(50ms) > 0) {
  }
  const auto cpu = [] {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec);
  };
  const auto before_cpu = cpu();
  const auto before = std::chrono::steady_clock::now();
  EXPECT_EQ(client.poll(400ms), 0U);
  EXPECT_GE(std::chrono::steady_clock::now() - before, 400ms);
  EXPECT_LT(cpu() - before_cpu, 100ms);
}

TEST(Client, WrongNamesAreQuoted) {
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom"); }), HasSubstr("expected NAME@host"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("@localhost"); }), HasSubstr("expected NAME@host"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@"); }), HasSubstr("expected host"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@host:70000"); }), HasSubstr("\"70000\""));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@tcp://host:0"); }), HasSubstr("1 to 65535"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@tcp://[::1]:3883"); }), HasSubstr("IPv6"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@::1"); }), HasSubstr("IPv6"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@file:x"); }), HasSubstr("reads no files"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@unix:x"); }), HasSubstr("unix:/path"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@http://x"); }), HasSubstr("expected host,"));
  EXPECT_THAT(textOf<ConnectError>([] { Client("Phantom@nowhere.invalid"); }), HasSubstr("nowhere.invalid"));
}

TEST(Client, NothingListensOnTheUnixSocket) {
  const std::string text =
      textOf<ConnectError>([] { Client("Phantom@unix:/nowhere", {.connectTimeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("nothing listens on unix:/nowhere (cannot use the Unix socket /nowhere"));
  EXPECT_THAT(text, HasSubstr("correct the path"));
}

TEST_P(BothWays, NothingListens) {
  std::uint16_t port = 0;
  std::string device;
  {
    ScriptedServer server;
    port = server.port();
    device = name(server);
  }
  const std::string text = textOf<ConnectError>([&] { Client(device, {.connectTimeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("nothing listens on 127.0.0.1:" + std::to_string(port)));
  EXPECT_THAT(text, HasSubstr("start `hapticd serve`"));
}

TEST(Client, NoSuchDevice) {
  ScriptedServer server;
  const std::string text = textOf<ConnectError>(
      [&] { Client("Phantm@tcp://127.0.0.1:" + std::to_string(server.port()), {.connectTimeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("no device 'Phantm' answers"));
  EXPECT_THAT(text, HasSubstr("it has Phantom"));
}

TEST(Client, AServerThatIsSilentAfterItsGreetingIsNotSaidToHaveNoDevice) {
  const auto cookie = wire::encodeCookie(0);
  ScriptedServer server({.greetingBytes = {reinterpret_cast<const char*>(cookie.data()), cookie.size()}});
  const std::string text = textOf<ConnectError>([&] { Client(server.tcpName(), {.connectTimeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("no device 'Phantom' answers"));
  EXPECT_THAT(text, HasSubstr("it has named none: it has no device, or it hangs"));
}

TEST(Client, NamesOfDevicesDoNotReachTheTerminalAsTheyAre) {
  ScriptedServer server({.device = "Phan\x1b[2Jtom\n"});
  const std::string text = textOf<ConnectError>(
      [&] { Client("Phantm@tcp://127.0.0.1:" + std::to_string(server.port()), {.connectTimeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("it has Phan\xef\xbf\xbd[2Jtom\xef\xbf\xbd"));
}

TEST(Client, NotAVrpnServer) {
  ScriptedServer server({.greetingBytes = "HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n"});
  const std::string text = textOf<ConnectError>([&] { Client(server.tcpName(), {.connectTimeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("broke the VRPN protocol"));
}

TEST(Client, AConnectionThatIsLostBeforeTheDeviceAnswersIsTheCause) {
  ScriptedServer server({.answersPings = false});
  std::thread damage([&] {
    while (server.connections() == 0) std::this_thread::sleep_for(1ms);
    server.sendRawBytes(std::string(24, '\xff'));
  });
  const std::string text = textOf<ConnectError>([&] { Client(server.tcpName(), {.reconnect = false}); });
  damage.join();
  EXPECT_THAT(text, HasSubstr("no VRPN server at 127.0.0.1:" + std::to_string(server.port())));
  EXPECT_THAT(text, HasSubstr("broke the VRPN protocol"));
}

/// The network of a program that has no file descriptor left.
class NoDescriptors final : public net::Network {
 public:
  std::unique_ptr<net::Loop::Impl> makeLoop() override {
    throw std::system_error(EMFILE, std::system_category());
  }
  std::uint32_t resolve(const std::string&) override { return net::kLoopbackAddress; }
  std::uint32_t localAddressTowards(const std::string&) override { return net::kLoopbackAddress; }
};

TEST(Client, AProgramWithoutAFreeDescriptorIsToldSo) {
  NoDescriptors none;
  const net::ScopedNetwork scope(none);
  const std::string text = textOf<ConnectError>([] { Client("Phantom@tcp://127.0.0.1:1"); });
  EXPECT_THAT(text, HasSubstr("no server at 127.0.0.1:1: "));
  EXPECT_THAT(text, HasSubstr("open files"));
}

/// The system's network, as seen by a machine whose own address changes.
class Roaming final : public net::Network {
 public:
  std::unique_ptr<net::Loop::Impl> makeLoop() override { return system_.makeLoop(); }
  std::uint32_t resolve(const std::string& host) override { return system_.resolve(host); }
  std::uint32_t localAddressTowards(const std::string& host) override {
    if (address == 0) throw net::Error("no route to " + host);
    return address;
  }
  std::uint32_t address = net::kLoopbackAddress + 1;  // 127.0.0.2; 0: there is no network

 private:
  net::Network& system_ = net::network();
};

TEST(Client, ItsRequestsNameTheAddressThatItsMachineHasNow) {
  Roaming machine;
  const net::ScopedNetwork scope(machine);
  net::Loop loop;
  net::UdpSocket requests(loop, {net::kLoopbackAddress, 0});
  std::optional<wire::UdpRequest> request;
  requests.start({.onDatagram =
                      [&](auto bytes, const net::Endpoint&) {
                        if (const auto read = wire::parseUdpRequest(bytes)) request = *read;
                      },
                  .onRefused = {}});
  Client client("Phantom@127.0.0.1:" + std::to_string(requests.local().port), {.connectTimeout = 0ms});
  const auto until = [&](auto&& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition() && std::chrono::steady_clock::now() < end) {
      client.poll(1ms);
      loop.runOnce(1ms);
    }
    return condition();
  };
  const auto asksFrom = [&](const char* host) {
    return until([&] { return request && request->host == host; });
  };
  ASSERT_TRUE(asksFrom("127.0.0.2"));
  machine.address = 0;
  client.runFor(1500ms);
  machine.address = net::kLoopbackAddress + 2;
  ASSERT_TRUE(asksFrom("127.0.0.3"));

  bool called = false;
  net::Connection call =
      net::Connection::connect(loop, net::Endpoint::parse(request->host, request->port), 2s);
  call.start({.onConnected = [&] { called = true; }});
  EXPECT_TRUE(until([&] { return called; })) << "it listens there";
}

/// The system's network with one more name, whose address changes, and whose later lookups may take long.
class Naming final : public net::Network {
 public:
  std::unique_ptr<net::Loop::Impl> makeLoop() override { return system_.makeLoop(); }
  std::uint32_t resolve(const std::string& host) override {
    if (host != "lab.example") return system_.resolve(host);
    if (++asked_ > 1 && slow) {
      ++waiting;
      answer.acquire();
      --waiting;
    }
    if (address == 0) throw net::Error("cannot find host '" + host + "'");
    return address;
  }
  std::uint32_t localAddressTowards(const std::string& host) override {
    return system_.localAddressTowards(host);
  }
  std::atomic<std::uint32_t> address{net::kLoopbackAddress};
  std::atomic<bool> slow{false};
  std::atomic<int> waiting{0};
  std::counting_semaphore<> answer{0};

 private:
  net::Network& system_ = net::network();
  std::atomic<int> asked_{0};
};

// A lookup that nobody waits for may outlive its test.
Naming& newNames() {
  static auto& all = *new std::vector<std::unique_ptr<Naming>>;
  return *all.emplace_back(std::make_unique<Naming>());
}

TEST_P(BothWays, AServerIsFoundAtTheAddressThatItsNameHasNow) {
  Naming& names = newNames();
  const net::ScopedNetwork scope(names);
  auto server = std::make_unique<ScriptedServer>();
  const std::uint16_t port = server->port();
  Client client((tcpOnly() ? "Phantom@tcp://lab.example:" : "Phantom@lab.example:") + std::to_string(port));
  server.reset();
  ASSERT_TRUE(pollUntil(client, [&] { return !client.connected(); }));
  names.address = 0;
  client.runFor(600ms);  // more than two attempts of TCP
  names.address = net::kLoopbackAddress + 1;
  server = std::make_unique<ScriptedServer>(
      ScriptedServerOptions{.port = port, .address = net::kLoopbackAddress + 1});
  EXPECT_TRUE(pollUntil(client, [&] { return client.connected(); }));
}

TEST_P(BothWays, ANameThatIsLookedUpForLongHoldsNothingUp) {
  Naming& names = newNames();
  names.slow = true;
  const net::ScopedNetwork scope(names);
  auto server = std::make_unique<ScriptedServer>();
  const std::uint16_t port = server->port();
  {
    Client client((tcpOnly() ? "Phantom@tcp://lab.example:" : "Phantom@lab.example:") + std::to_string(port));
    server.reset();
    ASSERT_TRUE(pollUntil(client, [&] { return names.waiting > 0; }));
    server = std::make_unique<ScriptedServer>(ScriptedServerOptions{.port = port});
    EXPECT_TRUE(pollUntil(client, [&] { return client.connected(); }));
    EXPECT_EQ(names.waiting, 1) << "one lookup at a time";
  }
  names.answer.release();
}

TEST(Client, KeepsCommandsBeforeTheFirstConnection) {
  std::uint16_t port = 0;
  {
    ScriptedServer server;
    port = server.port();
  }
  Client client("Phantom@tcp://127.0.0.1:" + std::to_string(port), {.connectTimeout = 0ms});
  client.setObjectCount(2);
  client.startEffect(4);
  client.poll(0ms);
  EXPECT_FALSE(client.connected());
  ScriptedServer server({.port = port});
  client.waitConnected(kPatience);
  client.flush();
  const auto received = server.waitReceived(2);
  ASSERT_EQ(received.size(), 2U);
  EXPECT_TRUE(is(received[0], wire::SetObjectNumber{2}));
  EXPECT_TRUE(is(received[1], wire::StartEffect{4}));
}

TEST_P(BothWays, TheLongestTimeoutsWaitAndDoNotOverflow) {
  ScriptedServer server;
  constexpr auto kForEver = std::chrono::milliseconds::max();
  Client client(name(server), {.connectTimeout = kForEver, .sendTimeout = kForEver, .queueLimit_bytes = 1});
  client.waitConnected(Client::Duration::max());
  client.waitConnected(Client::Duration::min());
  client.runFor(Client::Duration::min());
  for (int i = 0; i < 3000; ++i) client.setVertex(0, i, 0, 0, 0);
  client.flushAll();
  EXPECT_TRUE(client.connected());
}

TEST(Client, AFlushBeforeTheFirstConnectionSaysThatThereIsNone) {
  Client client("Phantom@tcp://127.0.0.1:1", {.connectTimeout = 0ms});
  client.setObjectCount(2);
  EXPECT_THAT(textOf<ConnectionLost>([&] { client.flushAll(); }),
              HasSubstr("nothing is sent yet: no VRPN server at 127.0.0.1:1: "));
}

TEST(Client, CommandsBeforeTheFirstConnectionAreBounded) {
  Client client("Phantom@tcp://127.0.0.1:1", {.connectTimeout = 0ms, .queueLimit_bytes = 100000});
  const auto fill = [&] {
    for (int i = 0; i < 10000; ++i) client.setVertex(0, i, 0, 0, 0);
  };
  EXPECT_THAT(textOf<ConnectError>(fill), HasSubstr("bytes wait to be sent"));
  const std::uint64_t kept = client.statistics().messagesOut;
  for (int i = 0; i < 100; ++i) EXPECT_THROW(client.setVertex(0, i, 0, 0, 0), ConnectError);
  EXPECT_EQ(client.statistics().messagesOut, kept) << "what is refused is not sent later";
}

TEST(Client, ALossByADamagedStreamIsReported) {
  ScriptedServer server;
  Client client(server.tcpName());
  std::vector<bool> reports;
  client.onConnection([&](const ConnectionReport& r) { reports.push_back(r.connected); });
  const auto end = std::chrono::steady_clock::now() + kPatience;
  const auto until = [&](std::size_t count) {
    while (reports.size() < count && std::chrono::steady_clock::now() < end) client.poll(1ms);
  };
  client.waitConnected(kPatience);
  client.poll(0ms);
  const std::size_t before = reports.size();
  server.sendRawBytes(std::string(100, '\xff'));
  until(before + 2);
  ASSERT_EQ(reports.size(), before + 2);
  EXPECT_FALSE(reports[before]);
  EXPECT_TRUE(reports[before + 1]);
}

}  // namespace
}  // namespace hapticd::test

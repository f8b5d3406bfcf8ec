// Attacks over the network on a server whose mock arm logs what its motors get.
//
// A hand rests in a contact. One after the other, each attack either must not change the force, or must end
// the force of the attacker's own effects; afterwards a stop from a new connection must reach the motors, and
// a re-arm must bring the force back. HAPTICD_ATTACK_TABLE=FILE writes the measured values as the table of
// docs/safety.md; they depend on the machine. What must not depend on it is asserted: how many ticks of the
// arm have force after the server has noticed the fault, by the time stamps of the arm's own log and of the
// server's.
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <fstream>
#include <limits>

#include "device/whole_server/in_contact.h"
#include "server/scripted_peer.h"
#include "wire/codec.h"

namespace hapticd::whole_server {
namespace {

using Clock = std::chrono::steady_clock;
using test::ScriptedPeer;

double milliseconds(Clock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

// A ramp of 250 ms, 50 in which the scene thread may begin it, and 20.
constexpr std::int64_t kRampOut_ticks = 250 + 50 + 20;

struct Row {
  std::string name;
  std::int64_t forceLeftTicks = -1;  // -1: the force had to stay
  double stop_ms = 0;
  double gap_ms = 0;
  double memory_MB = 0;
};

// The first contact after a stall may be too deep.
constexpr const char* kReleased = "Move the device out of the object";

class Attacks : public InContact {
 protected:
  void SetUp() override {
    if (const char* number = std::getenv("HAPTICD_ATTACK_LOAD"))
      busy_.resize(std::strtoul(number, nullptr, 10));
    socket_ = work.file("socket");
    std::ofstream(work.file("config.toml"))
        << "socket = \"" << socket_
        << "\"\n[limits]\nconnections = 400\nconnections_unfinished = 100\ncommands_per_second = 100000\n"
        << "[[device]]\nname = \"Phantom\"\n";
    serve({"--config", work.file("config.toml"), "--device", "openhaptics", "--http", "127.0.0.1:0"},
          {"HAPTICD_HDAPI_LIB=" MOCK_HD});
    ASSERT_FALSE(HasFatalFailure());
    address_ = net::Endpoint::parse("127.0.0.1", port("listening on 127.0.0.1:"));
    web_ = net::Endpoint::parse("127.0.0.1", port("viewer: http://127.0.0.1:"));
    visitor->client().onForce([this](const ForceReport&) { noteReport(); });
    visitor->client().onPose([this](const PoseReport&) { noteReport(); });
  }
  void TearDown() override {
    busy_.clear();
    if (const char* file = std::getenv("HAPTICD_ATTACK_TABLE")) writeTable(file);
    EXPECT_GE(2 * checked_, static_cast<int>(rows_.size())) << "most attacks leave the server's log usable";
    endInOrder();
  }

  std::uint16_t port(const std::string& before) const {
    const std::string log = server->log();
    const std::size_t at = log.find(before);
    return at == std::string::npos ? 0
                                   : static_cast<std::uint16_t>(std::atoi(log.c_str() + at + before.size()));
  }
  void noteReport() {
    const auto now = Clock::now();
    if (lastReport_ != Clock::time_point{})
      row_.gap_ms = std::max(row_.gap_ms, milliseconds(now - lastReport_));
    lastReport_ = now;
  }
  double memory_MB() const {
    std::ifstream status("/proc/" + std::to_string(server->id()) + "/status");
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with("VmRSS:")) return std::atof(line.c_str() + 6) / 1024;
    }
    return 0;
  }
  // When the server wrote the first line with this text behind `from` bytes of its log, since 1970.
  std::optional<std::int64_t> loggedAt(const std::string& text, std::size_t from) const {
    const std::string log = server->log();
    const std::size_t at = log.find(text, from);
    if (at == std::string::npos) return std::nullopt;
    const std::size_t line = log.rfind('\n', at) + 1;
    int hours = 0;
    int minutes = 0;
    int milliseconds = 0;
    int seconds = 0;
    if (std::sscanf(log.c_str() + line, "%d:%d:%d.%d", &hours, &minutes, &seconds, &milliseconds) != 4)
      return std::nullopt;
    // The log has the time of day.
    const std::time_t now = std::time(nullptr);
    std::tm day{};
    localtime_r(&now, &day);
    const std::int64_t today = now - (day.tm_hour * 3600 + day.tm_min * 60 + day.tm_sec);
    const std::int64_t then = today + hours * 3600 + minutes * 60 + seconds;
    return (then > now + 60 ? then - 86400 : then) * 1'000'000'000 + milliseconds * std::int64_t{1'000'000};
  }
  // The log is written by a thread of its own, and lines that clients cause are limited.
  std::optional<std::int64_t> eventuallyLogged(const std::string& text, std::size_t from) {
    for (int i = 0; i < 20; ++i) {
      if (const auto time = loggedAt(text, from)) return time;
      visitor->client().runFor(1ms);
    }
    return std::nullopt;
  }
  // The ticks in which this held, after the millisecond of `time`.
  std::int64_t ticksAfter(std::int64_t time, const std::function<bool(const Vec3& force)>& holds) const {
    std::int64_t count = 0;
    for (std::int64_t tick = arm->ticks - 1; tick >= 0 && arm.at(tick).time_ns > time + 1'000'000; --tick)
      count += holds(arm.force(tick)) ? 1 : 0;
    return count;
  }
  bool rests() {
    const std::int64_t tick = arm->ticks - 1;
    return right(tick);
  }

  // The attack runs while the operator goes on reading reports.
  void attack(const std::string& name, const std::function<void()>& run) {
    SCOPED_TRACE(name);
    ASSERT_TRUE(visitor->until([&] {
      if (visitor->latched()) visitor->client().rearmForces();
      return rests();
    })) << "before: "
        << server->log();
    row_ = {name};
    lastReport_ = {};
    visitor->client().runFor(5ms);
    run();
    finish();
  }
  // The attacker's part of a force, along x: what is across the contact's, which is smaller for a while after
  // a late tick.
  double pulling_N(const Vec3& force) const {
    const Vec3 contact = expected[static_cast<std::size_t>(deep)].normalized();
    return (force - force.dot(contact) * contact).x();
  }
  // The attacker's part of the force must end after the fault.
  void attackThatEnds(const std::string& name, const std::function<void()>& prepare,
                      const std::function<void()>& fault, const std::function<bool()>& ended) {
    attack(name, [&] {
      prepare();
      const double added_N = pulling_N(arm.left());
      const std::int64_t before = arm->ticks;
      const std::size_t logged = server->log().size();
      fault();
      EXPECT_TRUE(visitor->until(ended));
      const auto remains = [&](const Vec3& force) { return pulling_N(force) / added_N >= 0.1; };
      if (const auto noticed = loggedAt("disconnected", logged)) {
        EXPECT_LE(ticksAfter(*noticed, remains), kRampOut_ticks);
      }
      std::int64_t tick = arm->ticks - 1;
      while (tick > before && !remains(arm.force(tick))) --tick;
      row_.forceLeftTicks = tick - before;
    });
  }

  // After every attack: a stop reaches the motors, nobody re-arms but a client, and the force comes back.
  void finish() {
    const auto begin = Clock::now();
    const std::size_t logged = server->log().size();
    {
      Client panel("Phantom@tcp://" + address_.text(), {.connectTimeout = 60s, .reconnect = false});
      panel.stopForces();
      panel.flushAll();
      EXPECT_TRUE(visitor->until([&] { return arm.left().isZero(); })) << server->log();
      row_.stop_ms = milliseconds(Clock::now() - begin);
      const auto received = eventuallyLogged("stops the forces", logged);
      if (received) {
        constexpr std::int64_t kMost = 20;
        EXPECT_LE(ticksAfter(*received, [](const Vec3& force) { return !force.isZero(); }), kMost);
        ++checked_;
      }
      const std::int64_t zero = arm->ticks;
      EXPECT_TRUE(visitor->until([&] { return arm->ticks > zero + 20; }));
      for (std::int64_t tick = zero + 3; tick < zero + 20; ++tick)
        EXPECT_TRUE(arm.force(tick).isZero()) << tick;
      // An operator: the attacker's own stops may stand, too.
      Client person("Phantom@unix:" + socket_, {.connectTimeout = 60s, .reconnect = false});
      person.rearmForces();
      person.flushAll();
      EXPECT_TRUE(visitor->until([&] {
        person.poll(0ms);
        return !person.latest().guard.stopped || !arm.left().isZero();
      }));
    }
    row_.memory_MB = memory_MB();
    EXPECT_LT(row_.memory_MB, 150) << "docs/limits.md";
    peers_.clear();
    sockets_.clear();
    EXPECT_TRUE(visitor->until([&] {
      const GuardReport& guard = visitor->client().latest().guard;
      if (visitor->latched() || guard.stopped) {
        visitor->client().rearmForces();
        visitor->client().runFor(20ms);
        return false;
      }
      return rests() || visitor->heard(kReleased);
    })) << "after: "
        << server->log();
    // A stall of the machine may have released the contact, which the hand must leave then.
    if (!rests()) touch();
    visitor->forget();
    rows_.push_back(row_);
  }

  // A process that computes for as long as this lives.
  class Busy {
   public:
    Busy() : process_(fork()) {
      if (process_ != 0) return;
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      for (std::atomic<unsigned> count{0};;) count.fetch_add(1, std::memory_order_relaxed);
    }
    ~Busy() {
      kill(process_, SIGKILL);
      waitpid(process_, nullptr, 0);
    }
    Busy(const Busy&) = delete;
    Busy& operator=(const Busy&) = delete;

   private:
    pid_t process_;
  };

  ScriptedPeer& peer(ScriptedPeer::Mode mode = ScriptedPeer::Mode::tcp) {
    ScriptedPeer& added = peers_.emplace_back(address_, "Phantom", mode);
    EXPECT_TRUE(mode == ScriptedPeer::Mode::tcp || added.untilCalledBack());
    EXPECT_TRUE(added.untilConnected());
    return added;
  }

  // A socket that only this test knows how to use.
  class Socket {
   public:
    Socket(const net::Endpoint& to, int type = SOCK_STREAM) : id_(socket(AF_INET, type | SOCK_CLOEXEC, 0)) {
      sockaddr_in address{};
      address.sin_family = AF_INET;
      address.sin_port = htons(to.port);
      address.sin_addr.s_addr = htonl(to.address);
      connected_ = connect(id_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
      fcntl(id_, F_SETFL, O_NONBLOCK);
    }
    ~Socket() { close(id_); }
    Socket(const Socket&) = delete;
    Socket& operator=(const Socket&) = delete;
    bool connected() const { return connected_; }
    // How much the other side took.
    std::size_t write(std::string_view bytes) {
      const ssize_t sent = ::send(id_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      return sent > 0 ? static_cast<std::size_t>(sent) : 0;
    }
    void writeUrgently(char byte) { ::send(id_, &byte, 1, MSG_OOB | MSG_NOSIGNAL); }
    void endWriting() { ::shutdown(id_, SHUT_WR); }
    void reset() {
      const linger now{1, 0};
      setsockopt(id_, SOL_SOCKET, SO_LINGER, &now, sizeof now);
    }

   private:
    int id_;
    bool connected_ = false;
  };
  Socket& socketTo(const net::Endpoint& to, int type = SOCK_STREAM) {
    return sockets_.emplace_back(to, type);
  }
  void poll() { visitor->client().poll(0ms); }
  void attackWithBytes(const std::string& name, std::string_view bytes, int times = 1) {
    attack(name, [&] {
      for (int i = 0; i < times; ++i) {
        socketTo(address_).write(bytes);
        poll();
      }
      visitor->client().runFor(20ms);
    });
  }
  void attackWithHttp(const std::string& name, const std::string& request, int times = 1) {
    attack(name, [&] {
      for (int i = 0; i < times; ++i) {
        socketTo(web_).write(request);
        poll();
      }
      visitor->client().runFor(20ms);
    });
  }
  template <wire::WireMessage M>
  void attackWithMessage(const std::string& name, const M& message, int times = 1) {
    attack(name, [&] {
      ScriptedPeer& attacker = peer();
      for (int i = 0; i < times; ++i) {
        attacker.queue(message);
        if (i % 500 == 0) {
          attacker.flush();
          attacker.poll();
          poll();
        }
      }
      attacker.flush();
      for (int i = 0; i < 20; ++i) {
        attacker.poll();
        visitor->client().runFor(1ms);
      }
    });
  }
  static std::string cookie() {
    std::string text("vrpn: ver. 07.35  0");
    text.resize(24, '\0');
    return text;
  }
  static std::string header(std::uint32_t length, std::int32_t sender, std::int32_t type) {
    std::string bytes;
    for (const std::uint32_t value :
         {length, 0U, 0U, static_cast<std::uint32_t>(sender), static_cast<std::uint32_t>(type), 0U}) {
      for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xff);
    }
    return bytes;
  }
  void writeTable(const char* file) const {
    std::ofstream out(file, std::ios::app);
    for (const Row& row : rows_) {
      char line[256];
      char force[32] = "as before";
      if (row.forceLeftTicks >= 0)
        std::snprintf(force, sizeof force, "%ld", static_cast<long>(row.forceLeftTicks));
      std::snprintf(line, sizeof line, "| %s | %s | %.0f | %.0f | %.0f |\n", row.name.c_str(), force,
                    row.stop_ms, row.gap_ms, row.memory_MB);
      out << line;
    }
  }

  net::Endpoint address_;
  net::Endpoint web_;
  std::string socket_;
  std::deque<Busy> busy_;  // HAPTICD_ATTACK_LOAD=NUMBER: the machine has other work
  std::deque<ScriptedPeer> peers_;
  std::deque<Socket> sockets_;
  std::vector<Row> rows_;
  Row row_;
  Clock::time_point lastReport_;
  int blocked_ = 0;
  int checked_ = 0;  // stops whose ticks of force were counted
};

TEST_F(Attacks, OfBytes) {
  attack("none, for comparison", [&] { visitor->client().runFor(100ms); });
  attackWithBytes("connects and sends nothing, 200 times", "", 200);
  attackWithBytes("a greeting of 64 kB", std::string(65536, 'v'));
  attackWithBytes("a greeting of zeros", std::string(24, '\0'));
  attackWithBytes("another protocol", "GET / HTTP/1.1\r\nHost: x\r\n\r\n");
  attackWithBytes("a frame of 4 GB", cookie() + header(0xffffffffU, 0, 1));
  attackWithBytes("a frame shorter than its header", cookie() + header(3, 0, 1));
  attackWithBytes("a frame without an end, 50 times", cookie() + header(65000, 0, 1) + "x", 50);
  attackWithBytes("a sender that does not exist", cookie() + header(24, 0x7fffffff, 3));
  attackWithBytes("a negative type", cookie() + header(24, 0, -100));
  attackWithBytes("a type description without a name", cookie() + header(24, 0, -2));
  attackWithBytes("a name of 4 GB", cookie() + header(28, 0, -1) + std::string("\xff\xff\xff\xff", 4));
  attack("1 byte a packet", [&] {
    Socket& socket = socketTo(address_);
    for (const char byte : cookie() + header(24, 0, 3)) {
      socket.write({&byte, 1});
      poll();
    }
  });
  attackWithBytes("a greeting of version 99", std::string("vrpn: ver. 99.99  0") + std::string(5, '\0'));
  attackWithBytes("a description of number 2000000",
                  cookie() + header(24 + 8, 2'000'000, -1) + std::string("\0\0\0\3ab\0\0", 8));
  attack("urgent bytes, and an end of writing, 100 times", [&] {
    for (int i = 0; i < 100; ++i) {
      Socket& socket = socketTo(address_);
      socket.write(cookie());
      socket.writeUrgently('!');
      socket.endWriting();
      poll();
    }
    visitor->client().runFor(20ms);
  });
  attack("200 connections that end by a reset", [&] {
    for (int i = 0; i < 200; ++i) {
      Socket socket(address_);
      socket.reset();
      socket.write(cookie());
      poll();
    }
  });
  attack("300 connections that stay", [&] {
    for (int i = 0; i < 300; ++i) {
      socketTo(address_).write(cookie());
      poll();
    }
    visitor->client().runFor(50ms);
  });
  attack("more connections than there may be", [&] {
    constexpr int kMost = 400;  // as the server is configured
    for (int i = 0; i < kMost + 100; ++i) {
      socketTo(address_).write(cookie());
      poll();
    }
    // The port's own reserve, and the Unix socket's, which no flood on the port reaches.
    Client local("Phantom@unix:" + socket_, {.connectTimeout = 60s, .reconnect = false});
    local.stopForces();
    local.flushAll();
    EXPECT_TRUE(visitor->until([&] { return arm.left().isZero(); })) << server->log();
    local.rearmForces();
    EXPECT_TRUE(visitor->until([&] {
      local.poll(0ms);
      return !local.latest().guard.stopped;
    }));
  });
  attack("300 connections that never greet and stay", [&] {
    for (int i = 0; i < 300; ++i) {
      socketTo(address_).write("vrpn: ver. 07");
      poll();
    }
    visitor->client().runFor(50ms);
  });
  attack("300 requests for a call-back to closed ports", [&] {
    Socket& socket = socketTo(address_, SOCK_DGRAM);
    for (int i = 0; i < 300; ++i) {
      const std::string request = "127.0.0.1 " + std::to_string(20000 + i);
      socket.write({request.c_str(), request.size() + 1});
      poll();
    }
    visitor->client().runFor(50ms);
  });
  attack("a call-back to the server itself", [&] {
    Socket& socket = socketTo(address_, SOCK_DGRAM);
    for (const char* host : {"127.0.0.1", "127.0.0.2", "127.1.2.3", "localhost"}) {
      const std::string request = std::string(host) + " " + std::to_string(address_.port);
      for (int i = 0; i < 5; ++i) socket.write({request.c_str(), request.size() + 1});
      visitor->client().runFor(20ms);
    }
  });
  attack("2000 datagrams that are no request", [&] {
    Socket& socket = socketTo(address_, SOCK_DGRAM);
    for (int i = 0; i < 2000; ++i) {
      socket.write(std::string(static_cast<std::size_t>(i % 900), static_cast<char>(i)));
      if (i % 50 == 0) poll();
    }
  });
}

TEST_F(Attacks, OfTheWebPort) {
  const std::string host = "Host: 127.0.0.1:" + std::to_string(web_.port) + "\r\n";
  attackWithHttp("an unfinished request, 100 times", "GET / HTT", 100);
  attackWithHttp("a head of 1 MB", "GET / HTTP/1.1\r\n" + std::string(1 << 20, 'a'));
  attackWithHttp("100 times the metrics", "GET /metrics HTTP/1.1\r\n" + host + "\r\n", 100);
  attackWithHttp("100 times the state", "GET /api/state HTTP/1.1\r\n" + host + "\r\n", 100);
  attackWithHttp("a path out of the pages", "GET /../../../../etc/passwd HTTP/1.1\r\n" + host + "\r\n");
  attackWithHttp("a page of another site", "GET /api/state HTTP/1.1\r\nHost: evil.example\r\n\r\n");
  attackWithHttp("a body of 1 TB", "POST / HTTP/1.1\r\n" + host + "Content-Length: 1099511627776\r\n\r\n");
  attackWithHttp("an unknown transfer coding",
                 "GET / HTTP/1.1\r\n" + host + "Transfer-Encoding: xchunked\r\n\r\n5\r\n");
  attackWithHttp("zeros", std::string(4096, '\0'));
  const std::string upgrade = "GET /vrpn HTTP/1.1\r\n" + host +
                              "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                              "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
  attack("2 MB of pings on a WebSocket that is never read", [&] {
    Socket& socket = socketTo(web_);
    socket.write(upgrade);
    visitor->client().runFor(20ms);
    std::string pings;
    for (int i = 0; i < 10000; ++i) pings += std::string("\x89\x80\x01\x02\x03\x04", 6);
    for (std::size_t sent = 0; sent < (2U << 20);) {
      const std::size_t now = socket.write(pings);
      sent += now;
      visitor->client().poll(1ms);
      if (now == 0 && ++blocked_ > 200) break;
    }
  });
  attackWithHttp("a length of -1", "GET / HTTP/1.1\r\n" + host + "Content-Length: -1\r\n\r\n");
  attackWithHttp("two lengths and a coding",
                 "POST / HTTP/1.1\r\n" + host +
                     "Content-Length: 3\r\nContent-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n");
  attackWithHttp(
      "a mesh of no scene",
      "GET /api/mesh?scene=99999999999999999999&object=-1&geometry=x HTTP/1.1\r\n" + host + "\r\n");
  std::string pipelined;
  for (int i = 0; i < 1000; ++i) pipelined += "GET /api/messages HTTP/1.1\r\n" + host + "\r\n";
  attackWithHttp("1000 requests in one packet", pipelined);
  attack("a WebSocket frame without a mask", [&] {
    Socket& socket = socketTo(web_);
    socket.write(upgrade);
    visitor->client().runFor(20ms);
    socket.write(std::string("\x82\x03xyz", 5));
    visitor->client().runFor(20ms);
  });
  attack("a WebSocket message of 10,000 empty parts", [&] {
    Socket& socket = socketTo(web_);
    socket.write(upgrade);
    visitor->client().runFor(20ms);
    std::string parts("\x02\x80\1\2\3\4", 6);
    for (int i = 0; i < 10'000; ++i) parts += std::string("\0\x80\1\2\3\4", 6);
    socket.write(parts);
    visitor->client().runFor(50ms);
  });
  attack("a WebSocket frame of 2^63 bytes", [&] {
    Socket& socket = socketTo(web_);
    socket.write(upgrade);
    visitor->client().runFor(20ms);
    socket.write(std::string("\x82\xff\x7f\xff\xff\xff\xff\xff\xff\xff", 10));
    visitor->client().runFor(20ms);
  });
}

TEST_F(Attacks, OfMessages) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float huge = std::numeric_limits<float>::max();
  attackWithMessage(
      "a field of NaN",
      wire::ForceField{.origin = {nan, 0, 0}, .force = {nan, nan, nan}, .jacobian = {}, .radius = nan});
  attackWithMessage("a vertex number of 16 million, twice", wire::SetVertex{1, 15'999'999, {}}, 2);
  attackWithMessage("a negative vertex number", wire::SetVertex{0, -5, {}});
  attackWithMessage("an object that does not exist, 2000 times", wire::SetVertex{9999, 0, {}}, 2000);
  attackWithMessage("a million objects", wire::SetObjectNumber{1'000'000});
  attackWithMessage("10,000 objects", wire::SetObjectNumber{10'000});
  attackWithMessage("a vertex at 3e38", wire::SetVertex{2, 0, {huge, -huge, huge}});
  attackWithMessage("20,000 moves of the scene's origin, to where it is",
                    wire::SetSceneOrigin{{0, 0, 0}, {0, 0, 1}, 0}, 20000);
  attackWithMessage("20,000 stops", wire::StopForces{}, 20000);
  attackWithMessage("a report that only servers send, 1000 times", wire::Pong{}, 1000);
  attackWithMessage("1000 wrong tokens", wire::Identify{.token = "0123456789abcdef", .key = 1}, 1000);
  attackWithMessage("1000 re-arms", wire::RearmForces{}, 1000);
  attackWithMessage("20,000 pings", wire::Ping{}, 20000);
  attackWithMessage("5000 texts", wire::Text{.severity = 2, .level = 0, .text = std::string(200, '\x1b')},
                    5000);
  attackWithMessage("holds the real hand", wire::HoldHand{.hold = 1, .position = {1e300, 0, 0}});
  attackWithMessage("a report rate of NaN",
                    wire::TrackerSetUpdateRate{std::numeric_limits<double>::quiet_NaN()});
  attackWithMessage("more messages in a second than allowed", wire::Ping{}, 250'000);
  attackWithMessage("5000 markers", wire::Marker{.time = -1, .text = std::string(250, '\x07')}, 5000);
  attackWithMessage("20,000 questions, the answers unread", wire::QueryCapabilities{}, 20'000);
  attackWithMessage("subscribes to everything at an infinite rate",
                    wire::Subscribe{0xffffffffU, std::numeric_limits<double>::infinity()}, 1000);
  attackWithMessage("a held force of NaN", wire::HeldForce{1, {nan, 0, 0}, {}, 1e300});
  attackWithMessage("a held force of 1e308 N that ended before it came",
                    wire::HeldForce{1, {1e308, -1e308, 1e308}, {}, -1});
  attackWithMessage("a plane with a number of a million",
                    wire::Plane{.plane = {0, 1, 0, 0}, .stiffness = 1, .index = 1'000'000});
  attackWithMessage("an effect of number -2^31",
                    wire::Effect{.type = "constant",
                                 .index = std::numeric_limits<std::int32_t>::min(),
                                 .magnitude = std::numeric_limits<double>::max()});
  attackWithMessage("starts 5000 effects that nobody defined", wire::StartEffect{77}, 5000);
  attackWithMessage("a transform of infinities",
                    wire::SetTransformMatrix{1, {std::numeric_limits<double>::infinity()}}, 100);
  attackWithMessage("5000 commits of no batch", wire::BatchCommit{}, 5000);
  attack("100 clients that each leave a batch open", [&] {
    for (int i = 0; i < 100; ++i) {
      ScriptedPeer& attacker = peer();
      attacker.queue(wire::BatchBegin{});
      attacker.send(wire::SetObjectPosition{1, {0, 0, 0}});
      poll();
    }
    visitor->client().runFor(50ms);
  });
  attack("unknown types, 2000 of them", [&] {
    ScriptedPeer& attacker = peer();
    for (int i = 0; i < 1900; ++i) {
      attacker.sendForeign("attack " + std::to_string(i), {});
      if (i % 100 == 0) poll();
    }
  });
  attack("every message cut to 3 bytes", [&] {
    for (int kind = 0; kind < 20; ++kind) {
      ScriptedPeer& attacker = peer();
      attacker.sendPayload(static_cast<wire::MessageKind>(kind), std::vector<std::byte>(3));
      attacker.poll();
      poll();
    }
  });
  attack("a batch of 20 MB that stays open", [&] {
    ScriptedPeer& attacker = peer();
    attacker.queue(wire::BatchBegin{});
    for (int i = 0; i < 400'000; ++i) {
      attacker.queue(wire::SetVertex{1, i % 60'000, {0, 0, 0}});
      if (i % 1000 != 0) continue;
      attacker.flush();
      attacker.poll();
      poll();
    }
    attacker.flush();
    for (int i = 0; i < 100; ++i) {
      attacker.poll();
      visitor->client().runFor(1ms);
    }
  });
  attack("a client that never reads its reports", [&] {
    Socket& socket = socketTo(address_);
    socket.write(cookie());
    visitor->client().runFor(200ms);
  });
}

// The forces of the attacker's own effects must end with it.
TEST_F(Attacks, OfClientsThatVanish) {
  const wire::ForceField field{.origin = {0, 0, 0}, .force = {1, 0, 0}, .jacobian = {}, .radius = 100};
  const auto pulls = [&] { return std::abs(pulling_N(arm.left())) > 0.2; };
  const auto begin = [&] {
    ScriptedPeer& attacker = peer();
    attacker.send(field);
    EXPECT_TRUE(visitor->until([&] {
      attacker.poll();
      return pulls();
    }));
  };
  const auto ended = [&] { return rests(); };
  attackThatEnds(
      "a field, then the client is gone", begin, [&] { peers_.clear(); }, ended);
  attackThatEnds(
      "a field, then a reset in the middle of a frame", begin,
      [&] {
        peers_.back().sendBytes(std::as_bytes(std::span("\0\0\4", 3)));
        peers_.back().close();
      },
      ended);
  attackThatEnds(
      "a field, then a malformed message", begin,
      [&] {
        peers_.back().sendPayload(wire::kindOf<wire::SetVertex>, std::vector<std::byte>(3));
        for (int i = 0; i < 10; ++i) {
          peers_.back().poll();
          poll();
        }
      },
      ended);
  // The server waits 2 s for such a client to read the reason; the force must not wait with it.
  attackThatEnds(
      "a field, then a malformed message, and the connection is kept", begin,
      [&] {
        const std::size_t logged = server->log().size();
        const std::int64_t before = arm->ticks;
        peers_.back().sendPayload(wire::kindOf<wire::SetVertex>, std::vector<std::byte>(3));
        EXPECT_TRUE(visitor->until([&] { return loggedAt("disconnected: malformed", logged).has_value(); }));
        // Less than the contact's is right, too: what a stall of the machine took comes back slowly.
        const Vec3& resting = expected[static_cast<std::size_t>(deep)];
        EXPECT_TRUE(pulling_N(arm.left()) < 0.1 || arm->ticks - before < kRampOut_ticks)
            << arm.left().transpose() << " after " << arm->ticks - before << " ticks instead of "
            << resting.transpose();
      },
      ended);
  attackThatEnds(
      "a held force for an hour, then the client is gone",
      [&] {
        ScriptedPeer& attacker = peer();
        std::int64_t time = 1;
        EXPECT_TRUE(visitor->until([&] {
          attacker.send(wire::HeldForce{time++, {1, 0, 0}, {}, 3600});
          attacker.poll();
          return pulls();
        }));
      },
      [&] { peers_.clear(); }, ended);
  attackThatEnds(
      "a field, then a flood of pings beyond the limit", begin,
      [&] {
        for (int i = 0; i < 300'000 && peers_.back().open(); ++i) {
          peers_.back().queue(wire::Ping{});
          if (i % 1000 == 0) {
            peers_.back().flush();
            peers_.back().poll();
            poll();
          }
        }
        peers_.clear();
      },
      ended);
  attackThatEnds(
      "a field; gone while the scene is busy with another client's upload", begin,
      [&] {
        ScriptedPeer& busy = peer();
        busy.queue(wire::SetObjectNumber{10'000});
        for (int i = 0; i < 60'000; ++i) busy.queue(wire::SetSceneOrigin{{0, 0, 0}, {0, 0, 1}, 0});
        busy.flush();
        for (int i = 0; i < 50; ++i) {
          busy.poll();
          poll();
        }
        peers_.pop_front();
        busy.poll();
      },
      ended);
}

}  // namespace
}  // namespace hapticd::whole_server

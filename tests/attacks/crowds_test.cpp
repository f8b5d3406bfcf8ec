// Crowds: how long a stop takes, how long others wait, and how much memory the server needs while very many
// clients ask for too much. Takes minutes, prints a table, and runs with HAPTICD_LONG only; HAPTICD_CROWD
// selects the rows whose name contains it.
//
// The crowd is another process at the lowest priority, because it stands for other machines.
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <thread>
#include <vector>

#include "device/whole_server/in_contact.h"
#include "net/endpoint.h"
#include "wire/cookie.h"
#include "wire/frame_encoder.h"
#include "wire/peer.h"

namespace hapticd::whole_server {
namespace {

using Clock = std::chrono::steady_clock;

double elapsed_ms(Clock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

int connectTo(std::uint16_t port, int type = SOCK_STREAM) {
  const int id = socket(AF_INET, type | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(id, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    ::close(id);
    return -1;
  }
  fcntl(id, F_SETFL, O_NONBLOCK);
  return id;
}

void give(int id, const std::string& bytes) {
  if (id >= 0) [[maybe_unused]]
    const ssize_t sent = ::send(id, bytes.data(), bytes.size(), MSG_NOSIGNAL);
}

void discard(int id) {
  char bytes[65536];
  while (id >= 0 && ::recv(id, bytes, sizeof bytes, 0) > 0) {
  }
}

std::string cookie() {
  std::string text("vrpn: ver. 07.35  0");
  text.resize(24, '\0');
  return text;
}

// A greeting, the descriptions of the device and of a type, and one message of it, many times.
template <wire::WireMessage M>
std::string speech(const M& message, int times) {
  wire::LocalNames names;
  names.addSender("VRPN Control");
  const wire::LocalSender device = names.addSender("Phantom");
  wire::Peer peer(names);
  const std::string greeting = cookie();
  peer.feed({1, 2}, std::as_bytes(std::span(greeting)), [](const wire::Event&) {});
  for (int i = 0; i < times; ++i) peer.send({1, 2}, device, message);
  std::vector<std::byte> bytes;
  peer.takeStream(bytes);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class CrowdsTest : public InContact {
 protected:
  using Crowd = std::function<void()>;

  void SetUp() override {
    if (std::getenv("HAPTICD_LONG") == nullptr) GTEST_SKIP() << "takes minutes: set HAPTICD_LONG";
    rlimit limit{};
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);  // the server inherits it
    std::ofstream(work.file("config.toml"))
        << "socket = \"off\"\n[limits]\nconnections = 20000\nconnections_per_address = 20000\n"
        << "[[device]]\nname = \"Phantom\"\n";
    serve({"--config", work.file("config.toml"), "--device", "openhaptics", "--http", "127.0.0.1:0"},
          {"HAPTICD_HDAPI_LIB=" MOCK_HD});
    ASSERT_FALSE(HasFatalFailure());
    port_ = portAfter("listening on 127.0.0.1:");
    web_ = portAfter("viewer: http://127.0.0.1:");
    visitor->client().subscribe(Reports::tick, 1000);
    visitor->client().onTick([this](const TickReport&) { noteReport(); });
  }
  void TearDown() override {
    if (server) endInOrder();
  }

  std::uint16_t portAfter(const std::string& words) const {
    const std::string log = server->log();
    return static_cast<std::uint16_t>(std::atoi(log.c_str() + log.find(words) + words.size()));
  }
  void noteReport() {
    const auto now = Clock::now();
    if (lastReport_ != Clock::time_point{}) gaps_.push_back(elapsed_ms(now - lastReport_));
    lastReport_ = now;
  }
  double memory_MB() const {
    std::ifstream status("/proc/" + std::to_string(server->id()) + "/status");
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with("VmRSS:")) return std::atof(line.c_str() + 6) / 1024;
    }
    return 0;
  }

  // While the crowd runs: stops by an operator who was there before, and reports to the same client.
  void storm(const std::string& name, const Crowd& crowd, std::chrono::seconds settle) {
    const char* const wanted = std::getenv("HAPTICD_CROWD");
    if (wanted != nullptr && name.find(wanted) == std::string::npos) return;
    ASSERT_TRUE(visitor->until([&] {
      if (visitor->latched() || visitor->client().latest().guard.stopped) visitor->client().rearmForces();
      visitor->client().runFor(20ms);
      return right(arm->ticks - 1);
    })) << server->log();
    const pid_t attacker = fork();
    if (attacker == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      setpriority(PRIO_PROCESS, 0, 19);
      crowd();
      _exit(0);
    }
    lastReport_ = {};
    gaps_.clear();
    double memory = 0;
    for (const auto end = Clock::now() + settle; Clock::now() < end;) {
      visitor->client().runFor(50ms);
      memory = std::max(memory, memory_MB());
    }
    const std::vector<double> gaps = gaps_;
    std::vector<double> stops;
    for (int i = 0; i < kStops; ++i) {
      ASSERT_TRUE(visitor->until([&] {
        if (visitor->latched() || visitor->client().latest().guard.stopped) visitor->client().rearmForces();
        visitor->client().runFor(5ms);
        return !arm.left().isZero();
      })) << server->log();
      const auto begin = Clock::now();
      visitor->client().stopForces();
      visitor->client().flushAll();
      while (!arm.left().isZero() && Clock::now() < begin + 10s) std::this_thread::sleep_for(50us);
      stops.push_back(elapsed_ms(Clock::now() - begin));
      memory = std::max(memory, memory_MB());
    }
    int status = 0;
    EXPECT_EQ(waitpid(attacker, &status, WNOHANG), 0) << "the crowd must still be there";
    kill(attacker, SIGKILL);
    waitpid(attacker, &status, 0);
    std::printf("| %s | %.1f | %.1f | %.1f | %.1f | %.1f | %.0f |\n", name.c_str(), quantile(stops, 0.5),
                quantile(stops, 0.99), quantile(stops, 1), quantile(gaps, 0.99), quantile(gaps, 1), memory);
    std::fflush(stdout);
    EXPECT_LT(memory, kMost_MB) << "docs/limits.md";
    EXPECT_LT(quantile(stops, 0.5), 1000) << "a stop waits for a crowd";
  }

  static constexpr int kStops = 100;
  static constexpr double kMost_MB = 1024 + 200;  // memory_MB, and what the server has without clients
  std::uint16_t port_ = 0;
  std::uint16_t web_ = 0;
  std::vector<double> gaps_;
  Clock::time_point lastReport_;
};

[[noreturn]] void stay() {
  for (;;) pause();
}

TEST_F(CrowdsTest, DelayNoStop) {
  std::printf("| crowd | stop p50, ms | p99 | longest | gap p99, ms | longest | memory, MB |\n");
  storm(
      "none", [] { stay(); }, 5s);
  storm(
      "10,000 connections that greet and read nothing",
      [&] {
        for (int i = 0; i < 10'000; ++i) give(connectTo(port_), cookie());
        stay();
      },
      20s);
  storm(
      "none, after it", [] { stay(); }, 5s);
  storm(
      "10,000 connections that do not greet",
      [&] {
        for (int i = 0; i < 10'000; ++i) connectTo(port_);
        stay();
      },
      10s);
  storm(
      "1100 requests for a call-back in a second",
      [&] {
        const int id = connectTo(port_, SOCK_DGRAM);
        for (int i = 0;; ++i) {
          const std::string request = "127.0.0.1 " + std::to_string(20'000 + i % 20'000);
          give(id, request + '\0');
          std::this_thread::sleep_for(909us);
        }
      },
      10s);
  storm(
      "8 WebSockets whose pings are never answered to a reader",
      [&] {
        std::vector<int> ids;
        for (int i = 0; i < 8; ++i) {
          ids.push_back(connectTo(web_));
          give(ids.back(),
               "GET /vrpn HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(web_) +
                   "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                   "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
        }
        std::string pings;
        for (int i = 0; i < 10'000; ++i) pings += std::string("\x89\x80\x01\x02\x03\x04", 6);
        for (;;) {
          for (const int id : ids) give(id, pings);
          std::this_thread::sleep_for(1ms);
        }
      },
      10s);
  storm(
      "20 clients that fill batches and leave them open",
      [&] {
        const std::string begin = speech(wire::BatchBegin{}, 1);
        const std::string all = speech(wire::SetObjectPosition{1, {0, 0, 0}}, 100'000);
        std::vector<int> ids;
        for (int i = 0; i < 20; ++i) {
          ids.push_back(connectTo(port_));
          fcntl(ids.back(), F_SETFL, 0);
          give(ids.back(), begin);
        }
        // The descriptions are in both: the same numbers again.
        for (int round = 0; round < 20; ++round) {
          for (const int id : ids) give(id, all.substr(24));
        }
        stay();
      },
      15s);
  storm(
      "200 clients that do not read the answers to their questions",
      [&] {
        const std::string questions = speech(wire::QueryCapabilities{}, 50'000);
        std::vector<int> ids;
        for (int i = 0; i < 200; ++i) {
          ids.push_back(connectTo(port_));
          give(ids.back(), questions);
        }
        stay();
      },
      10s);
  storm(
      "60 pages that ask for /metrics, and 1000 clients",
      [&] {
        for (int i = 0; i < 1000; ++i) give(connectTo(port_), cookie());
        const std::string request =
            "GET /metrics HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(web_) + "\r\n\r\n";
        std::vector<int> pages(60, -1);
        for (;;) {
          for (int& page : pages) {
            if (page < 0) page = connectTo(web_);
            give(page, request);
            discard(page);
          }
          std::this_thread::sleep_for(20ms);
        }
      },
      15s);
  storm(
      "none, at the end", [] { stay(); }, 5s);
}

}  // namespace
}  // namespace hapticd::whole_server

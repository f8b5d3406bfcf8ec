#include "bench/helpers.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <regex>
#include <stdexcept>
#include <thread>

#include "bench/all.h"
#include "bench/sockets.h"
#include "bench/timing.h"
#include "handoff/spsc_ring.h"
#include "wire/frame_encoder.h"

namespace hapticd::bench {
namespace {

using namespace std::chrono_literals;

constexpr std::int64_t kPeriod_ns = 1'000'000;

using PipelineMessage = std::array<std::byte, kPipelineBytes>;

PipelineMessage stamped(std::int64_t time_ns) {
  PipelineMessage message{};
  std::memcpy(message.data(), &time_ns, sizeof time_ns);
  return message;
}

enum class Rights { servo, normal };

// Calls tick(time) at 1 kHz, for ever.
template <class Tick>
[[noreturn]] void pace(Tick&& tick, Rights rights = Rights::servo) {
  if (rights == Rights::servo) becomeRealtime();
  for (std::int64_t due = nowNs() + kPeriod_ns;; due = std::max(due + kPeriod_ns, nowNs())) {
    sleepUntilNs(due);
    tick(nowNs());
  }
}

// A realtime thread stamps each tick and wakes this one, of normal priority, which sends it: what is between
// a servo and its clients. As there, every tick is sent, however late the thread between was.
template <class Stamp, class Send>
[[noreturn]] void paceAndSend(Stamp stamp, Send send) {
  const int wake = eventfd(0, EFD_NONBLOCK);
  handoff::SpscRing<decltype(stamp(std::int64_t{}))> stamps(4096);
  std::thread servo([&] {
    pace([&](std::int64_t time) {
      stamps.push(stamp(time));
      eventfd_write(wake, 1);
    });
  });
  servo.detach();
  for (;;) {
    pollfd waiting{wake, POLLIN, 0};
    poll(&waiting, 1, -1);
    eventfd_t count = 0;
    eventfd_read(wake, &count);
    stamps.consume(send);
  }
}

// Thread, wake, thread, TCP, and nothing else.
int pipeline(std::uint16_t port) {
  Socket socket = Socket::connect(port);
  paceAndSend([](std::int64_t time) { return time; },
              [&](std::int64_t stamp) { socket.sendAll(stamped(stamp)); });
}

int plain(std::uint16_t port) {
  Socket socket = Socket::connect(port);
  pace([&](std::int64_t time) { socket.sendAll(stamped(time)); });
}

// Takes so many bytes, says so with one, and again.
int sink(std::uint16_t port, std::size_t bytes) {
  Socket socket = Socket::connect(port);
  std::vector<std::byte> buffer(256 * 1024);
  for (;;) {
    for (std::size_t got = 0; got < bytes;) {
      const std::size_t now = socket.receive({buffer.data(), std::min(buffer.size(), bytes - got)});
      if (now == 0) return 0;
      got += now;
    }
    socket.sendAll({buffer.data(), 1});
  }
}

// The five messages of one tick, as a server reports them.
void encodeTick(std::int64_t time_ns, std::uint64_t tick, wire::FrameEncoder& encoder) {
  const wire::LocalSender sender{1};
  encoder.clear();
  encoder.add({}, sender, wire::TrackerPosQuat{});
  encoder.add({}, sender, wire::TrackerPosQuat{});
  encoder.add({}, sender, wire::TrackerVelocity{});
  encoder.add({}, sender, wire::IsTouching{});
  wire::TickReport report;
  report.tick = tick;
  report.time = time_ns;
  encoder.add({}, sender, report);
}

wire::Time presentTime() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return {static_cast<std::uint32_t>(now.tv_sec), static_cast<std::uint32_t>(now.tv_nsec / 1000)};
}

// The messages of one tick for a client that did not choose, stamped in their headers.
void encodeDefaultTick(const wire::Time& stamp, wire::FrameEncoder& encoder) {
  const wire::LocalSender sender{1};
  encoder.clear();
  encoder.add(stamp, sender, wire::TrackerPosQuat{});
  encoder.add(stamp, sender, wire::TrackerVelocity{});
  encoder.add(stamp, sender, wire::IsTouching{});
}

enum class Messages { five, byDefault };

// By default messages go, as a server's, through a thread of normal priority, which a servo wakes.
int blaster(std::size_t clients, Messages messages) {
  raiseDescriptorLimit();
  Listener listener;
  std::printf("listening on 127.0.0.1:%d\n", static_cast<int>(listener.port()));
  std::fflush(stdout);
  std::vector<Socket> sockets;
  while (sockets.size() < clients) sockets.push_back(listener.accept());
  wire::FrameEncoder encoder;
  const auto sendToAll = [&] {
    const wire::ByteView bytes = encoder.bytes();
    for (const Socket& socket : sockets) {
      // Who has no room for a whole tick misses it.
      if (::send(socket.fd(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) continue;
      if (errno != EAGAIN && errno != EWOULDBLOCK) _exit(0);
    }
  };
  std::uint64_t tick = 0;
  if (messages == Messages::five) {
    pace([&](std::int64_t time) {
      encodeTick(time, ++tick, encoder);
      sendToAll();
    });
  }
  paceAndSend([](std::int64_t) { return presentTime(); },
              [&](const wire::Time& stamp) {
                encodeDefaultTick(stamp, encoder);
                sendToAll();
              });
}

// The policy of a stock server: one thread of normal priority, which sleeps, takes the present state and
// sends it to everybody. A tick that it cannot serve in time does not happen.
int stock(std::size_t clients) {
  raiseDescriptorLimit();
  Listener listener;
  std::printf("listening on 127.0.0.1:%d\n", static_cast<int>(listener.port()));
  std::fflush(stdout);
  std::vector<Socket> streams;
  std::vector<Socket> sockets;
  while (sockets.size() < clients) {
    streams.push_back(listener.accept());
    std::uint16_t port = 0;
    if (!streams.back().receiveAll(std::as_writable_bytes(std::span(&port, 1)))) return 1;
    sockets.push_back(Socket::connectDatagrams(port));
  }
  wire::FrameEncoder encoder;
  std::uint64_t tick = 0;
  pace(
      [&](std::int64_t time) {
        encodeTick(time, ++tick, encoder);
        const wire::ByteView bytes = encoder.bytes();
        for (const Socket& socket : sockets) {
          if (::send(socket.fd(), bytes.data(), bytes.size(), MSG_DONTWAIT) < 0 && errno == ECONNREFUSED)
            _exit(0);
        }
      },
      Rights::normal);
}

}  // namespace

int runHelper(const std::vector<std::string>& arguments) {
  const auto number = [&](std::size_t i) { return std::stoul(arguments.at(i)); };
  const auto port = [&] { return static_cast<std::uint16_t>(number(1)); };
  const std::string& role = arguments.at(0);
  if (role == "pipeline") return pipeline(port());
  if (role == "plain") return plain(port());
  if (role == "sink") return sink(port(), number(2));
  if (role == "blaster") return blaster(number(1), Messages::five);
  if (role == "default-blaster") return blaster(number(1), Messages::byDefault);
  if (role == "stock") return stock(number(1));
  if (role == "device-host") return hostStrokingDevice();
  throw std::invalid_argument("there is no helper '" + role + "'");
}

Helper::Helper(std::vector<std::string> arguments)
    : process_(
          [&] {
            arguments.insert(arguments.begin(), "--helper");
            return arguments;
          }(),
          work_ / "log") {}

std::uint16_t Helper::port() const {
  static const std::regex listening(R"(listening on [0-9.]+:([0-9]+))");
  for (int i = 0; i < 400; ++i) {
    const std::string log = process_.output();
    std::smatch found;
    if (std::regex_search(log, found, listening)) return static_cast<std::uint16_t>(std::stoi(found[1]));
    std::this_thread::sleep_for(25ms);
  }
  throw std::runtime_error("a helper did not start: " + process_.output());
}

}  // namespace hapticd::bench

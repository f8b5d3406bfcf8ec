// How old low-latency reports are under load: many clients with datagrams and busy threads on the same
// machine, against the policy of a stock server, which sends the present state whenever it gets to run.
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <fstream>
#include <memory>
#include <optional>
#include <thread>

#include "bench/all.h"
#include "bench/helpers.h"
#include "bench/sockets.h"
#include "bench/timing.h"
#include "realtime/servo/thread_setup.h"
#include "wire/codec.h"
#include "wire/frame.h"
#include "wire/peer.h"
#include "wire/udp_request.h"

namespace hapticd::bench {
namespace {

constexpr double kSmallestLimit_ms = 20;
constexpr double kWakeups = 3;            // the other limit, in wake-up errors of a bare thread
constexpr std::size_t kReadClients = 16;  // at least: the reports of the others are received only

// CLOCK_REALTIME less CLOCK_MONOTONIC, from the closest of some readings.
std::int64_t wallOffsetNs() {
  std::int64_t offset = 0;
  std::int64_t shortest = INT64_MAX;
  for (int i = 0; i < 100; ++i) {
    const std::int64_t before = nowNs();
    timespec wall{};
    clock_gettime(CLOCK_REALTIME, &wall);
    const std::int64_t after = nowNs();
    if (after - before >= shortest) continue;
    shortest = after - before;
    offset = std::int64_t{1'000'000'000} * wall.tv_sec + wall.tv_nsec - (before + after) / 2;
  }
  return offset;
}

// Threads that never rest, with the priority of everybody.
class BusyThreads {
 public:
  explicit BusyThreads(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      threads_.emplace_back([this] {
        while (!stop_.load(std::memory_order_relaxed)) {
        }
      });
    }
  }
  ~BusyThreads() {
    stop_ = true;
    for (std::thread& thread : threads_) thread.join();
  }
  BusyThreads(const BusyThreads&) = delete;
  BusyThreads& operator=(const BusyThreads&) = delete;

 private:
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

// Wakes each millisecond with the priority of the server's net thread and notes how late.
class BareThread {
 public:
  BareThread() : thread_([this] { watch(); }) {}
  ~BareThread() {
    if (thread_.joinable()) take();
  }
  BareThread(const BareThread&) = delete;
  BareThread& operator=(const BareThread&) = delete;

  /// Ends the thread.
  Samples take() {
    stop_ = true;
    thread_.join();
    return std::move(late_ms_);
  }

 private:
  void watch() {
    realtime::requestShortTimeSlice();
    for (std::int64_t due = nowNs() + 1'000'000; !stop_; due = std::max(due + 1'000'000, nowNs())) {
      sleepUntilNs(due);
      late_ms_.add(static_cast<double>(nowNs() - due) * 1e-6);
    }
  }

  std::atomic<bool> stop_{false};
  Samples late_ms_;
  std::thread thread_;
};

// One client with a datagram socket.
struct DatagramClient {
  Socket stream, datagrams;
  std::uint16_t port = 0;
  bool read = false;

  DatagramClient() : datagrams(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::bind(datagrams.fd(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error("cannot bind a datagram socket");
    socklen_t size = sizeof address;
    getsockname(datagrams.fd(), reinterpret_cast<sockaddr*>(&address), &size);
    port = ntohs(address.sin_port);
    const int on = 1;
    setsockopt(datagrams.fd(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    const int bytes = 4 << 20;
    setsockopt(datagrams.fd(), SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
  }

  /// Asks a server for its connection, as clients of VRPN do, and for every tick.
  void greet(std::uint16_t server) {
    Listener listener;
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(server);
    const std::string request = wire::formatUdpRequest({"127.0.0.1", listener.port()});
    ::sendto(datagrams.fd(), request.data(), request.size(), 0, reinterpret_cast<const sockaddr*>(&address),
             sizeof address);
    stream = listener.accept();
    wire::LocalNames names;
    const wire::LocalSender sender = names.addSender("Phantom");
    wire::Peer peer(names, {.udp = wire::UdpAddress{"127.0.0.1", port}, .log = {}});
    std::vector<std::byte> out;
    peer.takeStream(out);
    stream.sendAll(out);
    std::vector<std::byte> in(wire::kHeaderBytes);  // the length of a cookie, too
    if (!stream.receiveAll(in)) throw std::runtime_error("a client was refused");
    peer.feed({}, in, [](const wire::Event&) {});
    peer.send({}, sender,
              wire::Subscribe{
                  wire::kReportTracker | wire::kReportHip | wire::kReportForce | wire::kReportTick, 1000});
    peer.takeStream(out);
    stream.sendAll(out);
  }
  /// The same with the helper of the stock policy, which only needs the port.
  void greetHelper(std::uint16_t helper) {
    stream = Socket::connect(helper);
    stream.sendAll(std::as_bytes(std::span(&port, 1)));
  }
};

struct Ages {
  Samples all_ms, last_ms;   ///< of the whole time, and of its last quarter
  double reports_per_s = 0;  ///< per client
};

// Reads many clients in one thread. The age of a report is that of its arrival at the client's socket, as
// the kernel stamped it, so that a late reader is not counted as a late server.
class DatagramCrowd {
 public:
  DatagramCrowd(std::uint16_t port, std::size_t count, bool helper)
      : epoll_(epoll_create1(EPOLL_CLOEXEC)), offset_(wallOffsetNs()) {
    for (std::size_t i = 0; i < count; ++i) {
      auto client = std::make_unique<DatagramClient>();
      client->read = i % std::max<std::size_t>(1, count / kReadClients) == 0;
      if (helper) {
        client->greetHelper(port);
      } else {
        client->greet(port);
      }
      watch(client->datagrams.fd(), 2 * i);
      watch(client->stream.fd(), 2 * i + 1);
      clients_.push_back(std::move(client));
      if (i % 20 == 19) run(0.005, {});
    }
  }

  Ages hear(double seconds) {
    run(1, {});
    Ages ages;
    ages_ = &ages;
    const double first = run(seconds * 0.75, {.all = true, .last = false});
    const double second = run(seconds * 0.25, {.all = true, .last = true});
    ages.reports_per_s =
        static_cast<double>(ages.all_ms.count()) / (first + second) / static_cast<double>(readClients());
    ages_ = nullptr;
    return ages;
  }

 private:
  struct Keep {
    bool all = false;
    bool last = false;
  };

  std::size_t readClients() const {
    return static_cast<std::size_t>(
        std::count_if(clients_.begin(), clients_.end(), [](const auto& client) { return client->read; }));
  }

  void watch(int fd, std::size_t number) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = number;
    epoll_ctl(epoll_.fd(), EPOLL_CTL_ADD, fd, &event);
  }

  double run(double seconds, Keep keep) {
    const std::int64_t begin = nowNs();
    const std::int64_t end = begin + static_cast<std::int64_t>(seconds * 1e9);
    std::array<epoll_event, 1024> events{};
    while (nowNs() < end) {
      const int ready = epoll_wait(epoll_.fd(), events.data(), static_cast<int>(events.size()), 10);
      for (int i = 0; i < ready; ++i) {
        const std::size_t number = events[static_cast<std::size_t>(i)].data.u64;
        readFrom(number / 2 < clients_.size() ? clients_[number / 2].get() : nullptr, number % 2 == 1, keep);
      }
    }
    return static_cast<double>(nowNs() - begin) * 1e-9;
  }

  void readFrom(const DatagramClient* client, bool stream, Keep keep) {
    if (client == nullptr) return;
    if (stream) {
      if (::recv(client->stream.fd(), buffer_.data(), buffer_.size(), MSG_DONTWAIT) == 0)
        throw std::runtime_error("a client was sent away");
      return;
    }
    iovec part{buffer_.data(), buffer_.size()};
    std::array<char, 256> control{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t got = ::recvmsg(client->datagrams.fd(), &message, MSG_DONTWAIT);
    if (got <= 0 || !client->read || !keep.all) return;
    const std::optional<std::int64_t> arrived = arrival(message);
    if (!arrived) return;
    wire::FrameReader frames(wire::ByteView(buffer_.data(), static_cast<std::size_t>(got)));
    for (wire::FrameView frame; frames.next(frame);) {
      if (frame.header.type != wire::kLocalType<wire::TickReport>.value) continue;
      const auto report = wire::decode<wire::TickReport>(frame.payload);
      if (!report) continue;
      const double age_ms = static_cast<double>(*arrived - offset_ - report->time) * 1e-6;
      ages_->all_ms.add(age_ms);
      if (keep.last) ages_->last_ms.add(age_ms);
    }
  }

  static std::optional<std::int64_t> arrival(msghdr& message) {
    for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr; part = CMSG_NXTHDR(&message, part)) {
      if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_TIMESTAMPNS) continue;
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(part), sizeof stamp);
      return std::int64_t{1'000'000'000} * stamp.tv_sec + stamp.tv_nsec;
    }
    return std::nullopt;
  }

  Socket epoll_;
  const std::int64_t offset_;
  std::vector<std::unique_ptr<DatagramClient>> clients_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(64 * 1024);
  Ages* ages_ = nullptr;
};

class AgeUnderLoad {
 public:
  explicit AgeUnderLoad(const Run& run) : run_(run) {
    // Every report in every period, however little the hand moves.
    std::ofstream(work_ / "server.toml") << "[[device]]\nlinear_tolerance_mm = 0\n";
  }

  void of(std::size_t clients, std::size_t busy) {
    const std::string who = std::to_string(clients) + (clients == 1 ? " client" : " clients");
    const std::string load = std::to_string(busy) + " busy threads";
    run_.progress(who + ", " + load);
    const double seconds = run_.seconds(2, 12, 60);
    Samples wakeups_ms;
    Ages ours;
    Ages stock;
    {
      ServerProcess server("", {"--config", (work_ / "server.toml").string()});
      DatagramCrowd crowd(server.port(), clients, false);
      const BusyThreads threads(busy);
      BareThread bare;
      ours = crowd.hear(seconds);
      wakeups_ms = bare.take();
    }
    {
      Helper helper({"stock", std::to_string(clients)});
      DatagramCrowd crowd(helper.port(), clients, true);
      const BusyThreads threads(busy);
      stock = crowd.hear(seconds / 2);
    }
    row(who + ", " + load, ours, stock, wakeups_ms.summary());
  }
  Outcome take() { return std::move(outcome_); }

 private:
  void row(const std::string& what, const Ages& ours, const Ages& stock, const Summary& wakeups) {
    const double limit_ms = std::max(kSmallestLimit_ms, kWakeups * wakeups.p99);
    std::array<char, 160> note{};
    std::snprintf(note.data(), note.size(),
                  "each hears %.0f reports/s (stock policy %.0f); the bare thread's wake-up p99 %.2f ms",
                  ours.reports_per_s, stock.reports_per_s, wakeups.p99);
    Row row{what, "ms", ours.all_ms.summary(), stock.all_ms.summary(), {}, note.data()};
    row.checks.push_back({"p99 ms", row.ours.p99, limit_ms});
    row.checks.push_back({"p99 ms of the last quarter", ours.last_ms.summary().p99, limit_ms});
    outcome_.rows.push_back(row);
  }

  const Run& run_;
  WorkDirectory work_;
  Outcome outcome_;
};

}  // namespace

Outcome measureAge(const Run& run) {
  raiseDescriptorLimit();
  AgeUnderLoad ages(run);
  for (const std::size_t clients : {1, 250, 1000}) {
    for (const std::size_t busy : {0, 2, 8}) ages.of(clients, busy);
  }
  return ages.take();
}

}  // namespace hapticd::bench

// Five messages a tick to many clients, against a program that does nothing but send the same bytes.
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <fstream>

#include "bench/all.h"
#include "bench/helpers.h"
#include "bench/sockets.h"
#include "bench/timing.h"
#include "wire/codec.h"
#include "wire/cookie.h"
#include "wire/frame.h"
#include "wire/names.h"

namespace hapticd::bench {
namespace {

constexpr std::size_t kSampled = 16;  // clients whose reports are read, not only counted

// What readers of one sender saw.
struct Heard {
  Samples latency_us;
  double slowest_ticks_per_s = 0;
  double median_ticks_per_s = 0;
};

// How clients introduce themselves to a server.
enum class Manners {
  none,         // to a helper, which needs no greeting
  subscribes,   // describes the device and subscribes to five messages for each tick
  onlyListens,  // describes nothing: gets the default reports
};

std::int64_t wallUs() {
  timespec t{};
  clock_gettime(CLOCK_REALTIME, &t);
  return std::int64_t{1'000'000} * t.tv_sec + t.tv_nsec / 1000;
}

// Many clients in one thread: most count bytes, some read what there is. A tick's report is that of kind
// `tickType`, and its latency is that of the stamp in its header when it has no other.
class Crowd {
 public:
  Crowd(std::uint16_t port, std::size_t clients, Manners manners, wire::LocalType tickType)
      : epoll_(epoll_create1(EPOLL_CLOEXEC)), tickType_(tickType) {
    const bool greet = manners != Manners::none;
    std::vector<std::byte> hello =
        greeting(wire::kReportTracker | wire::kReportHip | wire::kReportForce | wire::kReportTick, 1000);
    if (manners == Manners::onlyListens) hello.resize(wire::kCookieBytes);
    for (std::size_t i = 0; i < clients; ++i) {
      readers_.push_back(
          {Socket::connect(port), i % std::max<std::size_t>(1, clients / kSampled) == 0, greet});
      if (greet) readers_.back().socket.sendAll(hello);
      epoll_event event{};
      event.events = EPOLLIN;
      event.data.u64 = i;
      epoll_ctl(epoll_.fd(), EPOLL_CTL_ADD, readers_.back().socket.fd(), &event);
      if (i % 50 == 49) run(0.02, nullptr);
    }
  }

  Heard hear(double seconds) {
    run(1, nullptr);  // greetings, and what had piled up
    for (Reader& reader : readers_) reader.bytes = reader.ticks = 0;
    Heard heard;
    const double took = run(seconds, &heard.latency_us);
    // Who is not read in full is counted by its bytes; a tick's are known from those who are.
    const double bytesPerTick = bytesOfTick();
    std::vector<double> rates;
    for (const Reader& reader : readers_)
      rates.push_back(static_cast<double>(reader.bytes) / bytesPerTick / took);
    std::sort(rates.begin(), rates.end());
    heard.slowest_ticks_per_s = rates.front();
    heard.median_ticks_per_s = rates[rates.size() / 2];
    return heard;
  }

  double bytesOfTick() const {
    double bytes = 0;
    double ticks = 0;
    for (const Reader& reader : readers_) {
      if (!reader.sampled) continue;
      bytes += static_cast<double>(reader.bytes);
      ticks += static_cast<double>(reader.ticks);
    }
    if (ticks == 0) throw std::runtime_error("no client heard of a tick");
    return bytes / ticks;
  }

 private:
  struct Reader {
    Socket socket;
    bool sampled = false;
    bool awaitsCookie = false;
    std::uint64_t bytes = 0;
    std::uint64_t ticks = 0;
    std::vector<std::byte> partial{};
  };

  double run(double seconds, Samples* latencies) {
    const std::int64_t begin = nowNs();
    const std::int64_t end = begin + static_cast<std::int64_t>(seconds * 1e9);
    std::array<epoll_event, 1024> events{};
    while (nowNs() < end) {
      const int ready = epoll_wait(epoll_.fd(), events.data(), static_cast<int>(events.size()), 10);
      for (int i = 0; i < ready; ++i) read(readers_[events[static_cast<std::size_t>(i)].data.u64], latencies);
    }
    return static_cast<double>(nowNs() - begin) * 1e-9;
  }

  void read(Reader& reader, Samples* latencies) {
    const ssize_t got = ::recv(reader.socket.fd(), buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (got == 0) throw std::runtime_error("a client was sent away");
    if (got < 0) return;
    reader.bytes += static_cast<std::uint64_t>(got);
    if (!reader.sampled) return;
    reader.partial.insert(reader.partial.end(), buffer_.begin(), buffer_.begin() + got);
    wire::ByteView bytes(reader.partial);
    if (reader.awaitsCookie && bytes.size() < wire::kCookieBytes) return;
    if (std::exchange(reader.awaitsCookie, false)) bytes = bytes.subspan(wire::kCookieBytes);
    const std::int64_t now = nowNs();
    const std::int64_t wall_us = wallUs();
    wire::FrameReader frames(bytes);
    for (wire::FrameView frame; frames.next(frame);) {
      if (frame.header.type != tickType_.value) continue;
      ++reader.ticks;
      if (latencies == nullptr) continue;
      if (const auto report = wire::decode<wire::TickReport>(frame.payload);
          report && tickType_ == wire::kLocalType<wire::TickReport>) {
        latencies->add(static_cast<double>(now - report->time) * 1e-3);
      } else {
        const wire::Time& stamp = frame.header.time;
        latencies->add(
            static_cast<double>(wall_us - std::int64_t{1'000'000} * stamp.seconds - stamp.microseconds));
      }
    }
    const std::vector<std::byte> rest(frames.rest().begin(), frames.rest().end());
    reader.partial = rest;
  }

  Socket epoll_;
  const wire::LocalType tickType_;
  std::vector<Reader> readers_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(64 * 1024);
};

class FanOut {
 public:
  explicit FanOut(const Run& run) : run_(run) {
    // Every report in every period, however little the hand moves.
    std::ofstream(work_ / "server.toml") << "[[device]]\nlinear_tolerance_mm = 0\n";
  }

  void of(std::size_t clients) {
    run_.progress(std::to_string(clients) + " clients");
    const Compared c = compare(clients, Manners::subscribes, wire::kLocalType<wire::TickReport>, "blaster");
    rows(clients, c.ours, c.raw, c.bytes);
  }
  // Loggers and filters of the raw protocol, and nobody else.
  void ofListeners(std::size_t clients) {
    const std::string who = std::to_string(clients) + " clients that describe nothing";
    run_.progress(who);
    const Compared c =
        compare(clients, Manners::onlyListens, wire::kLocalType<wire::IsTouching>, "default-blaster");
    outcome_.rows.push_back({who + ": ticks that each hears",
                             "1/s",
                             Summary::of(c.ours.median_ticks_per_s),
                             Summary::of(c.raw.median_ticks_per_s),
                             {{"ticks/s of who hears least", c.ours.slowest_ticks_per_s, 990, true, {}}},
                             std::to_string(static_cast<int>(c.bytes)) + " bytes a tick and client"});
    const Summary ours = c.ours.latency_us.summary();
    const Summary raw = c.raw.latency_us.summary();
    outcome_.rows.push_back({who + ": from the tick to the reader",
                             "us",
                             ours,
                             raw,
                             {{"p99 ratio", raw.p99 > 0 ? ours.p99 / raw.p99 : 0, 1.5}},
                             {}});
  }
  Outcome take() { return std::move(outcome_); }

 private:
  struct Compared {
    Heard ours, raw;
    double bytes = 0;
  };

  Compared compare(std::size_t clients, Manners manners, wire::LocalType tickType, const char* helper) const {
    const double seconds = run_.seconds(1.5, 5, 30);
    Compared compared;
    for (int half = 0; half < 2; ++half) {
      {
        ServerProcess server("", {"--config", (work_ / "server.toml").string()});
        Crowd crowd(server.port(), clients, manners, tickType);
        add(crowd.hear(seconds), compared.ours);
        compared.bytes = crowd.bytesOfTick();
      }
      Helper blaster({helper, std::to_string(clients)});
      Crowd crowd(blaster.port(), clients, Manners::none, tickType);
      add(crowd.hear(seconds), compared.raw);
    }
    return compared;
  }

  static void add(const Heard& half, Heard& all) {
    all.latency_us.add(half.latency_us);
    all.slowest_ticks_per_s += half.slowest_ticks_per_s / 2;
    all.median_ticks_per_s += half.median_ticks_per_s / 2;
  }

  void rows(std::size_t clients, const Heard& ours, const Heard& raw, double bytes) {
    const std::string who = std::to_string(clients) + (clients == 1 ? " client" : " clients");
    Row ticks{who + ": ticks that each hears",
              "1/s",
              Summary::of(ours.median_ticks_per_s),
              Summary::of(raw.median_ticks_per_s),
              {},
              std::to_string(static_cast<int>(bytes)) + " bytes a tick and client; who hears least: " +
                  std::to_string(static_cast<int>(ours.slowest_ticks_per_s)) + " (raw " +
                  std::to_string(static_cast<int>(raw.slowest_ticks_per_s)) + ")"};
    if (clients <= 64) {
      ticks.checks.push_back({"ticks/s", ours.median_ticks_per_s, 997, true, {}});
    } else {
      ticks.checks.push_back({"ticks/s", ours.median_ticks_per_s, 0.97 * raw.median_ticks_per_s, true, {}});
    }
    ticks.checks.push_back(
        {"ticks/s of who hears least", ours.slowest_ticks_per_s, 0.9 * ours.median_ticks_per_s, true, {}});
    Row latency{who + ": from the tick to the reader",
                "us",
                ours.latency_us.summary(),
                raw.latency_us.summary(),
                {},
                {}};
    latency.checks.push_back(
        {"p99 ratio", latency.yardstick->p99 > 0 ? latency.ours.p99 / latency.yardstick->p99 : 0, 1.2});
    outcome_.rows.push_back(ticks);
    outcome_.rows.push_back(latency);
  }

  const Run& run_;
  WorkDirectory work_;
  Outcome outcome_;
};

}  // namespace

Outcome measureFanOut(const Run& run) {
  raiseDescriptorLimit();
  FanOut fanOut(run);
  for (const std::size_t clients : {1, 16, 64, 255, 1000}) fanOut.of(clients);
  fanOut.ofListeners(64);
  return fanOut.take();
}

}  // namespace hapticd::bench

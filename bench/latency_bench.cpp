// From the servo's tick to the callback of a client on this machine, against a raw pipeline of the same
// shape.
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "bench/all.h"
#include "bench/helpers.h"
#include "bench/sockets.h"
#include "bench/timing.h"
#include "hapticd/client.h"

namespace hapticd::bench {
namespace {

using namespace std::chrono_literals;

constexpr double kPaperLimit_us = 300;
constexpr double kSettle_s = 0.2;  // after a process was let go on

// A stream of reports that can be heard for a while; its processes stand still meanwhile.
class Stream {
 public:
  virtual ~Stream() = default;
  /// Latencies of this many seconds.
  void hear(double seconds) {
    process().signal(SIGCONT);
    const std::int64_t begin = nowNs() + static_cast<std::int64_t>(kSettle_s * 1e9);
    listen(begin, begin + static_cast<std::int64_t>(seconds * 1e9));
    process().signal(SIGSTOP);
  }
  const Samples& latencies_us() const noexcept { return latencies_us_; }

 protected:
  virtual ChildProcess& process() = 0;
  virtual void listen(std::int64_t begin, std::int64_t end) = 0;
  void add(double us) { latencies_us_.add(us); }

 private:
  Samples latencies_us_;
};

class OurStream final : public Stream {
 public:
  explicit OurStream(bool spin) : client_(server_.device()), spin_(spin) {
    client_.subscribe(Reports::force, 1000);
    client_.onTouching([this](const TouchingReport& report) {
      const auto now = std::chrono::system_clock::now();
      if (nowNs() < begin_) return;
      add(std::chrono::duration<double, std::micro>(now - report.time).count());
    });
    client_.runFor(300ms);
    process().signal(SIGSTOP);
  }

 protected:
  ChildProcess& process() override { return server_.process(); }
  void listen(std::int64_t begin, std::int64_t end) override {
    begin_ = begin;
    while (nowNs() < end) client_.poll(spin_ ? 0ms : 20ms);
  }

 private:
  ServerProcess server_;
  Client client_;
  bool spin_;
  std::int64_t begin_ = 0;
};

class RawStream final : public Stream {
 public:
  explicit RawStream(const std::string& role)
      : helper_({role, std::to_string(listener_.port())}), socket_(listener_.accept()) {
    process().signal(SIGSTOP);
  }

 protected:
  ChildProcess& process() override { return helper_.process(); }
  void listen(std::int64_t begin, std::int64_t end) override {
    std::array<std::byte, kPipelineBytes> message{};
    std::int64_t now = 0;
    while (now < end && socket_.receiveAll(message)) {
      now = nowNs();
      std::int64_t stamp = 0;
      std::memcpy(&stamp, message.data(), sizeof stamp);
      if (now >= begin) add(static_cast<double>(now - stamp) * 1e-3);
    }
  }

 private:
  Listener listener_;
  Helper helper_;
  Socket socket_;
};

std::string sharesOf(const Samples& s) {
  std::array<char, 256> text{};
  const Summary all = s.summary();
  std::snprintf(
      text.data(), text.size(),
      "mean %.1f, SD %.1f; under 100 us %.3f %%, 100 to 200 us %.3f %%, 200 to 300 us %.3f %%, above %.3f %%",
      all.mean, all.deviation, 100 * s.shareWithin(0, 100), 100 * s.shareWithin(100, 200),
      100 * s.shareWithin(200, 300), 100 * s.shareWithin(300, 1e12));
  return text.data();
}

// The windows are not of one length: shares, not counts.
double percentAbove(const Samples& s, double us) {
  return 100 * s.shareWithin(us, 1e12);
}

Row against(const std::string& what, const Stream& ours, const Stream& raw) {
  const Samples& our = ours.latencies_us();
  const Samples& their = raw.latencies_us();
  Row row{what, "us", our.summary(), their.summary(), {}, sharesOf(our)};
  row.checks.push_back({"mean ratio", row.ratio(true), 1.3});
  row.checks.push_back({"% under 300 us", 100 * our.shareWithin(0, kPaperLimit_us), 99.99, true, {}});
  row.checks.push_back(
      {"% above 1 ms (raw's own is the limit)", percentAbove(our, 1000), percentAbove(their, 1000)});
  return row;
}

}  // namespace

Outcome measureLatency(const Run& run) {
  // 49,200 samples at 1 kHz, as the paper's Table 5, unless short.
  const int rounds = static_cast<int>(run.seconds(2, 8, 8));
  const double polled_s = run.seconds(2.5, 49.2 / 8, 49.2 / 8);
  const double others_s = run.seconds(2, 2, 49.2 / 8);
  OurStream polling(false);
  OurStream spinning(true);
  RawStream pipeline("pipeline");
  RawStream plain("plain");
  for (int round = 0; round < rounds; ++round) {
    run.progress("round " + std::to_string(round + 1) + " of " + std::to_string(rounds));
    polling.hear(polled_s);
    pipeline.hear(polled_s);
    spinning.hear(others_s);
    plain.hear(others_s);
  }
  Outcome outcome;
  outcome.rows = {against("our client waiting in poll", polling, pipeline),
                  against("our client spinning", spinning, pipeline),
                  {"- plain TCP without the thread between",
                   "us",
                   plain.latencies_us().summary(),
                   std::nullopt,
                   {},
                   sharesOf(plain.latencies_us())}};
  outcome.remarks.push_back("The raw pipeline: " + sharesOf(pipeline.latencies_us()));
  outcome.remarks.push_back("The paper: 99.68 % under 300 us.");
  outcome.figures.push_back({"latency",
                             "From the tick to the callback of a client",
                             "us",
                             0,
                             360,
                             {{"hapticd, client in poll", polling.latencies_us()},
                              {"hapticd, client spinning", spinning.latencies_us()},
                              {"raw pipeline", pipeline.latencies_us()}}});
  return outcome;
}

}  // namespace hapticd::bench

// How long a stop takes while other clients upload: from stopForces() to the first tick that writes zero.
#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "bench/all.h"
#include "bench/server_process.h"
#include "bench/sockets.h"
#include "bench/timing.h"
#include "hapticd/client.h"

namespace hapticd::bench {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// Sends vertices as fast as the server takes them, at the lowest priority, until stopped.
class Uploader {
 public:
  explicit Uploader(std::uint16_t port) : thread_([this, port] { run(port); }) {}
  ~Uploader() {
    stop_ = true;
    thread_.join();
  }
  Uploader(const Uploader&) = delete;
  Uploader& operator=(const Uploader&) = delete;

 private:
  void run(std::uint16_t port) {
    ::setpriority(PRIO_PROCESS, 0, 19);
    static const std::vector<std::byte> bytes = vertexMessages(1'000'000);
    constexpr std::size_t kPiece = 64 * 1024;  // stop_ is read between pieces
    try {
      while (!stop_) {
        Socket socket = Socket::connect(port);
        for (std::size_t at = 0; at < bytes.size() && !stop_; at += kPiece)
          socket.sendAll(std::span(bytes).subspan(at, std::min(kPiece, bytes.size() - at)));
      }
    } catch (const std::exception&) {
      // The server ends before the uploader does.
    }
  }

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// A client that has nothing but a button: stops, sees the force end, re-arms, and again.
class Operator {
 public:
  explicit Operator(const std::string& device) : owner_(device), client_(device) {
    client_.subscribe(Reports::tick, 1000);
    client_.onTick([this](const TickReport& tick) {
      force_N_ = std::hypot(tick.force_N[0], tick.force_N[1], tick.force_N[2]);
      if (force_N_ == 0 && !zeroAt_ && tick.tickTime > stoppedAt_) zeroAt_ = tick.tickTime;
    });
    owner_.subscribe(Reports::button);
    owner_.holdHand({});
    push();
  }

  // Milliseconds from the call to the tick; less than 0: none within the limit.
  double stopOnce() {
    if (!until([&] { return force_N_ > 0.5; })) return -1;
    zeroAt_.reset();
    stoppedAt_ = Clock::now().time_since_epoch();
    client_.stopForces();
    client_.flush();
    const bool zero = until([&] { return zeroAt_.has_value(); });
    client_.rearmForces();
    push();
    return zero ? std::chrono::duration<double, std::milli>(*zeroAt_ - stoppedAt_).count() : -1;
  }

 private:
  // A field that presses with 1 N wherever the hand is.
  void push() {
    owner_.setForceField({.origin_m = {}, .force_N = {0, 1, 0}, .jacobian_N_per_m = {}, .radius_m = 10});
    owner_.flush();
  }
  bool until(const std::function<bool()>& condition) {
    for (const auto end = Clock::now() + 20s; !condition(); client_.poll(5ms), owner_.poll(0ms)) {
      if (Clock::now() > end) return false;
    }
    return true;
  }

  Client owner_;
  Client client_;
  double force_N_ = 0;
  std::chrono::nanoseconds stoppedAt_{};
  std::optional<std::chrono::nanoseconds> zeroAt_;
};

Samples stopsWhile(int uploaders, double seconds, std::uint64_t& late) {
  const ServerProcess server;
  Operator person(server.device());
  std::vector<std::unique_ptr<Uploader>> others;
  for (int i = 0; i < uploaders; ++i) others.push_back(std::make_unique<Uploader>(server.port()));
  Samples samples;
  for (const auto end = Clock::now() + std::chrono::duration<double>(seconds); Clock::now() < end;) {
    const double took_ms = person.stopOnce();
    if (took_ms < 0) {
      ++late;
      break;
    }
    samples.add(took_ms);
  }
  return samples;
}

}  // namespace

Outcome measureStop(const Run& run) {
  constexpr double kLimit_ms = 5;
  const std::string reason = realtimeGranted() ? "" : "no SCHED_FIFO";
  const double seconds = run.seconds(8, 100, 100);
  Outcome outcome;
  std::uint64_t none = 0;
  run.progress("undisturbed");
  const Samples quiet = stopsWhile(0, seconds, none);
  for (const int uploaders : {1, 4, 16}) {
    run.progress(std::to_string(uploaders) + " uploading");
    std::uint64_t late = none;
    const Samples stops = stopsWhile(uploaders, seconds, late);
    Row row{
        "stop while " + std::to_string(uploaders) + (uploaders == 1 ? " client uploads" : " clients upload"),
        "ms",
        stops.summary(),
        quiet.summary(),
        {},
        late > 0 ? "a stop did not act within 20 s" : ""};
    row.checks.push_back({"p99 in ms", late > 0 ? 20'000 : row.ours.p99, kLimit_ms, false, reason});
    outcome.rows.push_back(std::move(row));
  }
  return outcome;
}

}  // namespace hapticd::bench

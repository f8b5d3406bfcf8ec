#include "server/station/device_keeper.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <stdexcept>
#include <utility>

#include "base/clock.h"
#include "base/world.h"

namespace hapticd::server {
namespace {

using base::Nanos;

constexpr Nanos kReopenAfter = 500'000'000;  // devices recover from shorter losses themselves
constexpr Nanos kRetryInterval = 2'000'000'000;
constexpr Nanos kHang = 1'000'000'000;  // a loop without a tick for so long is reported

}  // namespace

DeviceKeeper::DeviceKeeper(device::Device& device, realtime::Tick& tick, base::Clock& clock,
                           const DeviceKeeperOptions& options)
    : device_(device), tick_(tick), clock_(clock), options_(options), watchdog_(tick, clock) {}

void DeviceKeeper::start() {
  startLoop();
}

void DeviceKeeper::stop() noexcept {
  ending_ = true;
  device_.interrupt();
  if (attempt_.running()) attempt_.stop();
  stopLoop();
}

void DeviceKeeper::startLoop() {
  watchdog_.start();
  ended_ = tick_.finishedAt();
  begun_ = clock_.now();
  if (!device_.traits().selfPaced) {
    const realtime::ServoThreadOptions options{
        .rate_Hz = options_.rate_Hz, .request = {}, .requireRealtime = options_.requireRealtime};
    servo_.emplace([this](const realtime::Pacing& pacing) { tick_(pacing); }, clock_, options);
    const realtime::ThreadSetup& setup = servo_->start();
    realtime_ = setup.scheduling.granted;
    logSetup(setup);
    return;
  }
  if (options_.requireRealtime && !options_.vendorThread) demandRealtime();
  realtime::ThreadSetup memory;  // locks the memory of the process before the first tick
  memory.memory = realtime::setUpThread({.realtime = false}).memory;
  logSetup(memory);
  isPacedSetUp_ = false;
  device_.start([this, first = true](Nanos now) mutable {
    if (first) {
      pacedSetup_ = realtime::setUpThread({.keepScheduling = options_.vendorThread, .lockMemory = false});
      realtime_ = pacedSetup_.scheduling.granted;
      isPacedSetUp_.store(true, std::memory_order_release);
      first = false;
    }
    tick_(now);
  });
  spdlog::info("servo loop of '{}': paced by the device", options_.name);
}

// What a thread gets now, that of the loop will get, too: it begins with a tick, which is too late to refuse.
void DeviceKeeper::demandRealtime() const {
  if (base::world().threads.simulated()) return;
  realtime::ThreadSetup setup;
  base::BlockingThread({.name = "servo"}, [&] { setup = realtime::setUpThread({}); }).join();
  if (setup.scheduling.granted && setup.memory.granted) return;
  throw std::runtime_error(realtime::refusalOf(setup));
}

// The watchdog last: until then the last tick may hang.
void DeviceKeeper::stopLoop() noexcept {
  if (device_.traits().selfPaced) {
    device_.stop();
  } else {
    servo_.reset();
  }
  watchdog_.stop();
}

std::string DeviceKeeper::poll(Nanos now) {
  logPacedSetup();
  if (attempt_.running()) {
    if (!attemptDone_.load(std::memory_order_acquire)) return attemptText_;
    attempt_.stop();
    nextAttempt_ = now + kRetryInterval;
    lostSince_ = 0;
  }
  if (!openError_.empty()) {
    std::string refused = "the device does not open: " + openError_ + "; retrying every 2 s";
    // The attempt owns openError_ from here on.
    if (now >= nextAttempt_) startAttempt("the device is being reopened", [this] { reopen(); });
    return refused;
  }
  if (watchdog_.silence() > kHang) {  // the driver may hang as well: do not call it
    const char* const force = !watchdog_.overtook() ? "its last force stays until the device ends it"
                              : watchdog_.canZero() ? "the watchdog has ended its force"
                                                    : "the device or the isolation host ends its force";
    return std::string("the servo loop hangs: no tick has ended for more than 1 s; ") + force +
           "; restart the server if this lasts";
  }
  if (begun_ != 0 && tick_.finishedAt() == ended_ && clock_.now() - begun_ > kHang)
    return "the servo loop does not run: no tick has come since it began; restart the server";
  std::string fault = device_.faultText();
  if (!device_.lost()) {
    lostSince_ = 0;
  } else if (lostSince_ == 0) {
    lostSince_ = now;
  } else if (now - lostSince_ > kReopenAfter) {
    startAttempt("the device is being reopened", [this] { reopen(); });
    return fault;
  }
  if (fault.empty()) calibrationError_.clear();
  if (!calibrationError_.empty()) fault += "; the last calibration failed: " + calibrationError_;
  return fault;
}

void DeviceKeeper::calibrate() {
  if (attempt_.running() || !openError_.empty()) return;
  startAttempt("the device is being calibrated: keep hands off",
               [this, stops = tick_.control().stops()] { runCalibration(stops); });
}

void DeviceKeeper::startAttempt(std::string text, std::function<void()> attempt) {
  attemptText_ = std::move(text);
  attemptDone_ = false;
  attempt_ = base::Thread({.name = "device keeper"},
                          [this, attempt = std::move(attempt)]() -> std::optional<base::Nanos> {
                            if (attemptDone_.load(std::memory_order_relaxed))
                              return std::nullopt;  // the thread steps once more when it stops
                            attempt();
                            attemptDone_.store(true, std::memory_order_release);
                            return std::nullopt;
                          });
}

void DeviceKeeper::runCalibration(std::uint32_t stops) noexcept {
  const auto stopped = [&] {
    return ending_ || tick_.control().stopped() || tick_.control().stops() != stops;
  };
  calibrationError_.clear();
  try {
    if (stopped()) throw std::runtime_error("the forces were stopped before it began");
    device_.calibrate(stopped);
  } catch (const std::exception& error) {
    calibrationError_ = error.what();
  }
}

// The guard has latched the fault: the reopened device gives no force before a re-arm.
void DeviceKeeper::reopen() noexcept {
  std::string refusal;
  try {
    stopLoop();
    device_.close();
    closed_.store(true, std::memory_order_release);
    if (ending_) return;
    device_.open();
    closed_.store(false, std::memory_order_release);
    startLoop();
  } catch (const std::exception& error) {
    refusal = error.what();
    device_.close();
    closed_.store(true, std::memory_order_release);
  }
  openError_ = refusal;
}

// Refusals are one line: what is missing, what that costs, and the remedy.
void DeviceKeeper::logSetup(const realtime::ThreadSetup& setup) const {
  std::string refused;
  std::string remedy;
  for (const realtime::SetupAnswer* answer : setup.all()) {
    if (!answer->asked) continue;
    if (answer->granted) {
      spdlog::info("servo loop of '{}': {}", options_.name, answer->text);
      continue;
    }
    refused += (refused.empty() ? "" : "; ") + answer->text;
    if (remedy.find(answer->remedy) == std::string::npos)
      remedy += (remedy.empty() ? "" : "; ") + answer->remedy;
  }
  if (refused.empty()) return;
  spdlog::warn("servo loop of '{}': {}. Ticks may be late while the machine is busy. Remedy: {}",
               options_.name, refused, remedy);
}

void DeviceKeeper::logPacedSetup() {
  if (!isPacedSetUp_.load(std::memory_order_acquire)) return;
  logSetup(pacedSetup_);
  isPacedSetUp_ = false;
}

}  // namespace hapticd::server

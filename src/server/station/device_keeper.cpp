#include "server/station/device_keeper.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

#include "base/clock.h"

namespace hapticd::server {
namespace {

using base::Nanos;

constexpr Nanos kLostFor = 500'000'000;  // shorter pauses end by themselves
constexpr Nanos kBetweenAttempts = 2'000'000'000;

}  // namespace

DeviceKeeper::DeviceKeeper(device::Device& device, realtime::Tick& tick, base::Clock& clock,
                           const DeviceKeeperOptions& options)
    : device_(device), tick_(tick), clock_(clock), options_(options) {}

void DeviceKeeper::start() {
  startLoop();
}

void DeviceKeeper::stop() noexcept {
  if (attempt_.running()) attempt_.stop();
  stopLoop();
}

void DeviceKeeper::startLoop() {
  if (!device_.traits().selfPaced) {
    const realtime::ServoThreadOptions options{
        .rate_Hz = options_.rate_Hz, .request = {}, .requireRealtime = options_.requireRealtime};
    servo_.emplace([this](const realtime::Pacing& pacing) { tick_(pacing); }, clock_, options);
    const realtime::ThreadSetup& setup = servo_->start();
    realtime_ = setup.scheduling.granted;
    for (const realtime::SetupAnswer* answer : setup.all()) say(*answer);
    return;
  }
  say(realtime::setUpThread({.realtime = false}).memory);  // of the process, before the first tick
  isPacedSetUp_ = false;
  device_.start([this, first = true](Nanos now) mutable {
    if (first) {
      pacedSetup_ = realtime::setUpThread({.keepScheduling = options_.vendorsThread, .lockMemory = false});
      realtime_ = pacedSetup_.scheduling.granted;
      isPacedSetUp_.store(true, std::memory_order_release);
      first = false;
    }
    tick_(now);
  });
  spdlog::info("servo loop of '{}': paced by the device", options_.name);
}

void DeviceKeeper::stopLoop() noexcept {
  if (device_.traits().selfPaced) {
    device_.stop();
  } else {
    servo_.reset();
  }
}

std::string DeviceKeeper::look(Nanos now) {
  sayPacedSetup();
  if (attempt_.running()) {
    if (!attempted_.load(std::memory_order_acquire)) return doing_;
    attempt_.stop();
    nextAttempt_ = now + kBetweenAttempts;
    lostSince_ = 0;
  }
  if (!refusal_.empty()) {
    std::string refused = "the device does not open: " + refusal_ + "; it is tried again every 2 s";
    // refusal_ is the attempt's from here on.
    if (now >= nextAttempt_) begin("the device is being opened anew", [this] { openAnew(); });
    return refused;
  }
  std::string words = device_.faultText();
  if (!device_.lost()) {
    lostSince_ = 0;
  } else if (lostSince_ == 0) {
    lostSince_ = now;
  } else if (now - lostSince_ > kLostFor) {
    begin("the device is being opened anew", [this] { openAnew(); });
    return words;
  }
  if (words.empty()) notCalibrated_.clear();
  if (!notCalibrated_.empty()) words += "; the last calibration: " + notCalibrated_;
  return words;
}

void DeviceKeeper::calibrate() {
  if (attempt_.running() || !refusal_.empty()) return;
  begin("the device is being calibrated: keep hands off", [this] { tryToCalibrate(); });
}

void DeviceKeeper::begin(std::string doing, std::function<void()> attempt) {
  doing_ = std::move(doing);
  attempted_ = false;
  attempt_ = base::Thread({.name = "device keeper"}, [this, attempt = std::move(attempt)]() -> std::optional<base::Nanos> {
    if (attempted_.load(std::memory_order_relaxed)) return std::nullopt;  // the last step, at the end
    attempt();
    attempted_.store(true, std::memory_order_release);
    return std::nullopt;
  });
}

void DeviceKeeper::tryToCalibrate() noexcept {
  notCalibrated_.clear();
  try {
    device_.calibrate();
  } catch (const std::exception& error) {
    notCalibrated_ = error.what();
  }
}

// The guard has latched the fault: whatever comes back, no force does before a re-arm.
void DeviceKeeper::openAnew() noexcept {
  std::string refusal;
  try {
    stopLoop();
    device_.close();
    device_.open();
    startLoop();
  } catch (const std::exception& error) {
    refusal = error.what();
    device_.close();
  }
  refusal_ = refusal;
}

void DeviceKeeper::say(const realtime::SetupAnswer& answer) const {
  if (!answer.asked) return;
  if (answer.granted) {
    spdlog::info("servo loop of '{}': {}", options_.name, answer.text);
  } else {
    spdlog::warn("servo loop of '{}': {}; {}", options_.name, answer.text, answer.remedy);
  }
}

void DeviceKeeper::sayPacedSetup() {
  if (!isPacedSetUp_.load(std::memory_order_acquire)) return;
  for (const realtime::SetupAnswer* answer : pacedSetup_.all()) say(*answer);
  isPacedSetUp_ = false;
}

}  // namespace hapticd::server

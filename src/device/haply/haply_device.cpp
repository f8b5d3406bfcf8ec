#include "device/haply/haply_device.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <system_error>

#include "base/world.h"
#include "device/haply/haply_messages.h"
#include "device/haply/service_connection.h"
#include "device/profiles.h"

namespace hapticd::device {
namespace {

using namespace std::chrono_literals;

constexpr Nanos kMillisecond = 1'000'000;
constexpr auto kConnectTime = 1000ms;
constexpr auto kReplyTime = 20ms;
constexpr int kReconnect_ms = 200;
constexpr int kIdle_ms = 3;  // between messages without a new force, which keep the state fresh
constexpr Nanos kStateLife = 20'000'000;

}  // namespace

HaplyDevice::HaplyDevice(HaplyOptions options)
    : options_(std::move(options)), profile_(*findProfile("Inverse3")), deviceId_(options_.deviceId) {
  profile_.transportDelay_s = 0.001;
  wake_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
}

HaplyDevice::~HaplyDevice() {
  close();
  ::close(wake_);
}

void HaplyDevice::open() {
  if (thread_.running()) return;
  stopping_ = false;
  connected_ = failed_ = false;
  sample_.write({});
  thread_ = base::BlockingThread({.name = "haply", .priority = kDriverPriority}, [this] { run(); });
  while (!connected_ && !failed_) base::sleepFor(kMillisecond);
  if (!failed_) return;
  const std::string words = faultText();
  close();
  throw std::runtime_error("no Inverse3 at ws://" + options_.host + ":" + options_.port + ": " + words +
                           "; check that haply-inverse-service runs");
}

void HaplyDevice::close() noexcept {
  stopping_ = true;
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(wake_, &one, sizeof one);
  thread_.join();
}

void HaplyDevice::run() noexcept {
  while (!stopping_) {
    try {
      haply::ServiceConnection service(options_.host, options_.port, kConnectTime);
      take(service.receive(kConnectTime));
      serve(service);
    } catch (const std::exception& error) {
      say(error.what());
      failed_ = true;
    }
    connected_ = false;
    state_.hold |= kHoldFault;
    sample_.write({state_, state_.time != 0});
    for (int waited = 0; waited < kReconnect_ms && !stopping_; waited += 10)
      base::sleepFor(10 * kMillisecond);
  }
}

void HaplyDevice::serve(haply::ServiceConnection& service) {
  say({});
  connected_ = true;
  bool last = false;
  while (!last) {
    waitForCommand(kIdle_ms);
    last = stopping_;
    service.send(haply::forceMessage(deviceId_, last ? Vec3(Vec3::Zero()) : newestForce()), kReplyTime);
    take(service.receive(kReplyTime));
    sentZero_.sent(lastCommand_);
  }
}

void HaplyDevice::take(std::string_view text) {
  const auto message = haply::parseMessage(text, deviceId_);
  if (!message) {
    throw haply::MessageError(deviceId_.empty() ? "the service knows no Inverse3"
                                                : "the service knows no Inverse3 '" + deviceId_ + "'");
  }
  deviceId_ = message->deviceId;
  state_ = message->state;
  state_.time = base::now();
  hold_ = state_.hold;
  sample_.write({state_, true});
}

Vec3 HaplyDevice::newestForce() noexcept {
  const Command& command = command_.read();
  const Nanos now = base::now();
  if (command.number != lastCommand_) {
    lastCommand_ = command.number;
    commandTime_ = now;
  }
  const bool fresh = now - commandTime_ <= kCommandLife;
  return fresh && state_.hold == kHoldNone ? command.force_N : Vec3(Vec3::Zero());
}

void HaplyDevice::waitForCommand(int most_ms) noexcept {
  pollfd wanted{wake_, POLLIN, 0};
  if (poll(&wanted, 1, most_ms) <= 0) return;
  std::uint64_t count = 0;
  [[maybe_unused]] const auto got = ::read(wake_, &count, sizeof count);
}

bool HaplyDevice::read(Nanos now, DeviceState& state) noexcept {
  const Sample& newest = sample_.read();
  if (!newest.valid) return false;
  state = newest.state;
  if (now - state.time > kStateLife) state.hold |= kHoldFault;
  return true;
}

bool HaplyDevice::write(const Vec3& force_N) noexcept {
  if (!force_N.allFinite()) return false;
  const double size = force_N.norm();
  const double most = profile_.peakForce_N;
  command_.write({size > most ? Vec3(most / size * force_N) : force_N, ++commands_});
  sentZero_.wrote(commands_, force_N.isZero(0));
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(wake_, &one, sizeof one);
  return true;
}

std::string HaplyDevice::faultText() const {
  {
    const std::lock_guard lock(wordsMutex_);
    if (!words_.empty()) return words_;
  }
  const std::uint32_t hold = hold_;
  if ((hold & kHoldNotCalibrated) != 0)
    return "not calibrated: follow the Haply software's steps for the arm";
  if ((hold & kHoldDeadMan) != 0)
    return "the service says that the device is not ready; check its power supply";
  return {};
}

void HaplyDevice::say(const std::string& words) {
  const std::lock_guard lock(wordsMutex_);
  words_ = words;
}

}  // namespace hapticd::device

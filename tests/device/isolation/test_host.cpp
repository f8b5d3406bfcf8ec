// The driver's process of the tests: test_host MODE [FILE], where FILE holds an ObservedHand.
#include <fcntl.h>
#include <sys/mman.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <string>
#include <thread>

#include "device/isolation/device_host.h"
#include "device/isolation/observed_hand.h"
#include "device/openhaptics/openhaptics_device.h"

namespace hapticd::device {
namespace {

// A device that paces itself, or not, and does what the test says.
class ObservedDevice final : public Device {
 public:
  ObservedDevice(ObservedHand& hand, bool selfPaced) : hand_(hand), selfPaced_(selfPaced) {
    profile_.model = "observed";
    profile_.peakForce_N = 5;
  }
  ~ObservedDevice() override { close(); }

  void open() override {
    while (hand_.fault == 5) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  void close() noexcept override {
    stop();
    hand_.closed = 1;
  }
  const DeviceProfile& profile() const noexcept override { return profile_; }

  bool read(Nanos now, DeviceState& state) noexcept override {
    if (hand_.fault == 1) std::raise(SIGSEGV);
    while (hand_.fault == 2) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    state.time = now;
    state.position_m = Vec3(hand_.x, hand_.y, hand_.z);
    return true;
  }
  bool write(const Vec3& force_N) noexcept override {
    hand_.fx = force_N.x();
    hand_.fy = force_N.y();
    hand_.fz = force_N.z();
    return true;
  }
  std::string faultText() const override {
    while (hand_.fault == 6) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (hand_.fault == 4) return {};
    if (hand_.fault != 3) return "words of the driver";
    hand_.fault = 4;
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    return "told once";
  }
  bool lost() const noexcept override { return hand_.fault >= 6; }
  void calibrate(const std::function<bool()>& stopped) override {
    ++hand_.calibrations;
    while (hand_.fault == 5 && !stopped()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (stopped()) throw std::runtime_error("a person stopped it");
    if (hand_.calibrations > 1) throw std::runtime_error("once is enough");
  }

  DeviceTraits traits() const noexcept override {
    return {.selfPaced = selfPaced_, .calibratesInLoop = true, .needsRearm = false};
  }
  void start(std::function<void(Nanos)> onTick) override {
    leave_ = false;
    thread_ = std::thread([this, onTick = std::move(onTick)] {
      while (!leave_) {
        onTick(std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1));
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      write(Vec3::Zero());
    });
  }
  void stop() noexcept override {
    leave_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  ObservedHand& hand_;
  const bool selfPaced_;
  DeviceProfile profile_;
  std::atomic<bool> leave_{false};
  std::thread thread_;
};

class FailingDevice final : public Device {
 public:
  void open() override { throw std::runtime_error("no such arm"); }
  void close() noexcept override {}
  const DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(Nanos, DeviceState&) noexcept override { return false; }
  bool write(const Vec3&) noexcept override { return false; }

 private:
  DeviceProfile profile_;
};

}  // namespace
}  // namespace hapticd::device

int main(int argc, char** argv) {
  using namespace hapticd::device;
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode == "crash") std::raise(SIGSEGV);
  if (mode == "failing") {
    FailingDevice device;
    return runDeviceHost(device);
  }
  if (mode == "openhaptics") {
    OpenHapticsDevice device;
    return runDeviceHost(device);
  }
  const int file = open(argc > 2 ? argv[2] : "", O_RDWR | O_CLOEXEC);
  void* memory = mmap(nullptr, sizeof(ObservedHand), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (memory == MAP_FAILED) return 2;
  ObservedDevice device(*static_cast<ObservedHand*>(memory), mode == "selfpaced");
  return runDeviceHost(device);
}

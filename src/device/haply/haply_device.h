// Haply Inverse3 (and Minverse) through the Inverse Service on this machine.
//
// The service answers every message with one state, so each write of the servo triggers one exchange in a
// thread of the driver. The servo only stores its newest force and takes the newest state.
#pragma once

#include <atomic>
#include <mutex>
#include <string>

#include "base/thread.h"
#include "device/device.h"
#include "device/sent_zero.h"
#include "handoff/latest_value.h"

namespace hapticd::device {

namespace haply {
class ServiceConnection;
}

struct HaplyOptions {
  std::string host = "localhost";
  std::string port = "10001";
  std::string deviceId;  ///< empty: the first Inverse3
};

/// One tick of delay. A reply that takes more than 20 ms is a fault; the driver reconnects by itself.
class HaplyDevice final : public Device {
 public:
  explicit HaplyDevice(HaplyOptions options = {});
  ~HaplyDevice() override;

  void open() override;
  void close() noexcept override;
  const DeviceProfile& profile() const noexcept override { return profile_; }
  DeviceTraits traits() const noexcept override { return {.forceLife = kCommandLife}; }

  bool read(Nanos now, DeviceState& state) noexcept override;
  bool write(const Vec3& force_N) noexcept override;
  /// The service has answered the message with the zero.
  bool zeroSent() const noexcept override { return sentZero_.isSent(); }
  std::string faultText() const override;

 private:
  /// The driver's thread zeroes a force that is older than this.
  static constexpr Nanos kCommandLife = 20'000'000;

  struct Command {
    Vec3 force_N = Vec3::Zero();
    std::uint64_t number = 0;
  };
  struct Sample {
    DeviceState state;
    bool valid = false;
  };

  void run() noexcept;
  void serve(haply::ServiceConnection& service);
  void take(std::string_view text);
  Vec3 newestForce() noexcept;
  void waitForCommand(int most_ms) noexcept;
  void say(const std::string& words);

  const HaplyOptions options_;
  DeviceProfile profile_;
  int wake_ = -1;  // eventfd: a new force, or stop
  base::BlockingThread thread_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> connected_{false};
  std::atomic<std::uint32_t> hold_{kHoldNone};
  std::atomic<bool> failed_{false};  // at least once since open()
  mutable std::mutex wordsMutex_;
  std::string words_;  // why there is no connection

  handoff::LatestValue<Command> command_;
  handoff::LatestValue<Sample> sample_;

  // Servo thread only.
  std::uint64_t commands_ = 0;
  SentZero sentZero_;  // and the driver's thread

  // Driver's thread only.
  std::string deviceId_;  // once an arm was found, never that of another one
  DeviceState state_;
  std::uint64_t lastCommand_ = 0;
  Nanos commandTime_ = 0;
};

}  // namespace hapticd::device

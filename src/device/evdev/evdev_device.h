// Force-feedback joysticks and wheels through Linux evdev: two axes, x and z, or x alone.
//
// The kernel may block in an upload, so a thread of the driver exchanges with the device at up to 500 Hz. The
// servo only stores its newest force and takes the newest state. The driver zeroes a force that the servo has
// not renewed for 20 ms.
#pragma once

#include <array>
#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "base/thread.h"
#include "device/device.h"
#include "device/evdev/event_device.h"
#include "device/evdev/force_effects.h"
#include "device/evdev/wheel_profile.h"
#include "device/sent_zero.h"
#include "handoff/latest_value.h"

namespace hapticd::device {

struct EvdevOptions {
  std::string path;               ///< /dev/input/event*; empty: the first one with a constant force
  std::filesystem::path profile;  ///< a file for WheelProfile; empty: cautious guesses
};

/// An input device without force feedback: a keyboard, a mouse, a plain gamepad.
class NoForceFeedback : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class EvdevDevice final : public Device {
 public:
  explicit EvdevDevice(EvdevOptions options = {}) : options_(std::move(options)) {}
  /// For an open file; without a thread, the caller calls exchange().
  EvdevDevice(std::unique_ptr<EventDevice> file, const WheelProfile& profile, bool thread);
  ~EvdevDevice() override { close(); }

  void open() override;
  void close() noexcept override;
  const DeviceProfile& profile() const noexcept override { return profile_; }
  DeviceTraits traits() const noexcept override { return {.forceLife = kCommandLife}; }

  bool read(Nanos now, DeviceState& state) noexcept override;
  bool write(const Vec3& force_N) noexcept override;
  bool zeroSent() const noexcept override { return sentZero_.isSent(); }
  std::string faultText() const override;
  bool lost() const noexcept override { return error_ != 0; }

  /// One round with the device: events in, force out. For the driver's thread.
  void exchange(Nanos now) noexcept;

  /// The name of a device that open() would take. Throws NoForceFeedback, or std::system_error when it cannot
  /// be opened.
  static std::string probe(const std::string& path);

 private:
  /// The driver's thread zeroes a force that is older than this.
  static constexpr Nanos kCommandLife = 20'000'000;

  struct Axis {
    int code = 0;
    double centre = 0;
    double scale_m = 0;  // per count
    double value_m = 0;
    double before_m = 0;
    double velocity_m_per_s = 0;

    void place(int count) noexcept { value_m = scale_m * (count - centre); }
    void differentiate(double dt_s) noexcept;
  };
  struct Command {
    double x_N = 0;
    double z_N = 0;
    std::uint64_t number = 0;
  };
  struct Sample {
    DeviceState state;
    bool valid = false;
  };

  void findFile();
  void readCapabilities();
  Axis readAxis(int code, double travel_m);
  bool readPresentState() noexcept;
  bool readEvents() noexcept;
  void run() noexcept;

  const EvdevOptions options_;
  std::unique_ptr<EventDevice> file_;
  const bool given_ = false;  // the file was passed in
  const bool ownThread_ = true;
  WheelProfile wheel_;
  DeviceProfile profile_;
  std::optional<ForceEffects> effects_;
  base::BlockingThread thread_;
  std::atomic<bool> stopping_{false};
  std::atomic<int> error_{0};  // errno while the device does not answer

  handoff::LatestValue<Command> command_;
  handoff::LatestValue<Sample> sample_;
  std::uint64_t commands_ = 0;  // servo thread only
  SentZero sentZero_;

  // Exchanging thread only.
  std::array<Axis, 2> axes_;
  int axisCount_ = 1;
  std::uint32_t buttons_ = 0;
  int firstButton_ = 0;
  bool eventsAreMissing_ = false;  // the kernel dropped some
  std::uint64_t lastCommand_ = 0;
  Nanos commandTime_ = 0;
  Nanos before_ = 0;
  Nanos nextForce_ = 0;
  int failures_ = 0;
};

}  // namespace hapticd::device

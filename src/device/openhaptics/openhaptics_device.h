// Touch, Touch X, Phantom Omni, Desktop and Premium through OpenHaptics (HDAPI), which the user installs.
//
// The vendor's scheduler thread is the servo thread: each of its ticks is one frame, in which the state is
// sampled, the tick of the server runs, and the force is set once.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "device/device.h"
#include "device/openhaptics/hd_scheduler.h"
#include "device/openhaptics/thermal_derating.h"
#include "device/sent_zero.h"

namespace hapticd::device {

struct OpenHapticsOptions {
  std::string name;        ///< name in the vendor's setup tool; empty: the default device
  double rate_Hz = 1000;   ///< of the scheduler; the connection limits the choice
  bool calibrate = false;  ///< consent to calibrate at start, as calibrate() gives it
};

/// Self-paced. Several may be open at a time; opening or closing one interrupts the others for a moment.
class OpenHapticsDevice final : public Device, private hd::Participant {
 public:
  explicit OpenHapticsDevice(OpenHapticsOptions options = {}) : options_(std::move(options)) {}
  ~OpenHapticsDevice() override { close(); }

  void open() override;
  void close() noexcept override;
  const DeviceProfile& profile() const noexcept override { return profile_; }

  bool read(Nanos now, DeviceState& state) noexcept override;
  bool write(const Vec3& force_N) noexcept override;
  /// The frame of the zero has ended: one tick later.
  bool zeroSent() const noexcept override { return sentZero_.isSent(); }

  std::string faultText() const override;
  bool lost() const noexcept override { return lost_; }
  /// Encoder reset: the arm must be in its reset position. Inkwell: the stylus must be docked, which counts
  /// as consent where the device has the switch. The loop must run.
  void calibrate(const std::function<bool()>& stopped) override;
  using Device::calibrate;

  DeviceTraits traits() const noexcept override {
    return {.selfPaced = true, .ticksInVendorThread = true, .calibratesInLoop = true};
  }
  void start(std::function<void(Nanos)> onTick) override;
  void stop() noexcept override;

  /// Model, serial number, driver and the name that opened it. Valid after open().
  const std::string& description() const noexcept { return description_; }

 private:
  enum class Quiet { no, wanted, reached };

  void onFrame() noexcept override;
  void onError(hd::Enum code) noexcept override;
  void readIdentity();
  void readAxes();
  void sample(Nanos now) noexcept;
  void noticeSilence() noexcept;
  std::uint32_t holds(Nanos now) noexcept;
  void updateCalibration(hd::Enum status) noexcept;
  Vec3 limited(const Vec3& force_N) noexcept;

  const OpenHapticsOptions options_;
  std::shared_ptr<hd::Scheduler> scheduler_;
  hd::Handle handle_ = hd::kInvalidHandle;
  DeviceProfile profile_;
  std::string description_;
  int calibrationStyle_ = 0;
  bool hasSafetySwitch_ = false;
  double velocityLimit_m_per_s_ = 1.2;
  double impulseLimit_N_ = 4;

  std::function<void(Nanos)> onTick_;
  bool started_ = false;
  std::atomic<Quiet> quiet_{Quiet::no};
  std::atomic<bool> consent_{false};
  std::atomic<std::uint32_t> hold_{kHoldNone};
  std::atomic<hd::Enum> lastError_{hd::kSuccess};
  mutable std::atomic<bool> unreported_{false};  // a force error since faultText() was last called
  std::atomic<bool> lost_{false};                // until reopened
  std::atomic<bool> silent_{false};              // lost without an error

  // Scheduler thread only, from here on.
  ThermalDerating derating_{0, 0};
  DeviceState state_;
  DeviceState before_;  // of the frame before
  int sameFrames_ = 0;  // with a force, since the state last changed
  bool inTick_ = false;
  std::uint64_t commands_ = 0;
  SentZero sentZero_;
  bool refuses_ = false;  // forces, until the arm is slow again
  Vec3 command_N_ = Vec3::Zero();
  Vec3 written_N_ = Vec3::Zero();
  Nanos now_ = 0;
  std::uint64_t frames_ = 0;
  bool calibrated_ = false;
  int settling_ = 0;  // frames until the position after a calibration counts
  bool hot_ = false;
  Nanos hotUntil_ = 0;
  Nanos faultUntil_ = 0;
};

}  // namespace hapticd::device

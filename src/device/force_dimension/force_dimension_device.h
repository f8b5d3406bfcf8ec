// omega, delta, sigma and lambda by Force Dimension through libdrd or libdhd, which the user installs.
//
// Polled: read() and write() each exchange a USB frame, so the servo may run at up to 4 kHz. The amplifiers
// stay off until the first force, and the device switches them off by itself when it receives no command for
// 20 ms.
#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include "device/device.h"
#include "device/force_dimension/dhd_api.h"

namespace hapticd::device {

struct ForceDimensionOptions {
  int index = 0;                    ///< among the connected ones
  bool gravityCompensation = true;  ///< the motors carry the arm while the amplifiers are on
  double effectorMass_kg = 0;       ///< of a tool on the end; 0: the default of the device
  int timeGuard_us = 100;           ///< the calls of one tick share a USB frame; below the period of the loop
  double watchdog_s = 0.020;        ///< at most 31.8 ms; 0: off
};

class ForceDimensionDevice final : public Device {
 public:
  explicit ForceDimensionDevice(const ForceDimensionOptions& options = {}) : options_(options) {}
  ~ForceDimensionDevice() override { close(); }

  void open() override;
  void close() noexcept override;
  const DeviceProfile& profile() const noexcept override { return profile_; }
  DeviceTraits traits() const noexcept override {
    return {.forceLife = base::toNanos(std::max(options_.watchdog_s, 0.0))};
  }

  /// Button 0 is the device's own; button 1 is a closed gripper, whose opening is in the state, too.
  bool read(Nanos now, DeviceState& state) noexcept override;
  bool write(const Vec3& force_N) noexcept override;
  /// A calibration drives the motors by itself.
  bool zeroSent() const noexcept override { return !busy_; }

  std::string faultText() const override;
  bool lost() const noexcept override { return unreadable_; }
  /// MOVES THE ARM through its workspace when it is not calibrated. The next force switches on the amplifiers
  /// that the device switched off.
  void calibrate(const std::function<bool()>& stopped) override;
  using Device::calibrate;

  /// Model and serial number. Valid after open().
  const std::string& description() const noexcept { return description_; }

 private:
  class Turn;
  class Arms;

  int openArm(int count);
  std::optional<int> serialOf(int id) const;
  void closeArm(int id) const noexcept;
  void configure();
  [[noreturn]] void fail(const std::string& what) const;
  bool sample(Nanos now) noexcept;
  void sampleButtons() noexcept;
  void sampleGripper() noexcept;
  void checkStatus(Nanos now) noexcept;
  bool switchOn() noexcept;
  void moveToCalibrate(const std::function<bool()>& stopped);
  bool endRegulation() noexcept;

  const ForceDimensionOptions options_;
  std::unique_ptr<const dhd::Api> api_;
  int id_ = -1;
  std::optional<int> serial_;  // since the first opening: another arm is never taken for this one
  DeviceProfile profile_;
  std::string description_;
  std::atomic<std::uint32_t> hold_{kHoldNone};
  std::atomic<bool> busy_{false};  // one thread at a time in the library
  std::atomic<bool> amplifiersOn_{false};
  std::atomic<bool> calibrated_{false};
  std::atomic<bool> unreadable_{false};

  // Servo thread only.
  DeviceState state_;
  Nanos nextStatus_ = 0;
  int failures_ = 0;  // reads in a row
  bool deviceError_ = false;
  bool switchedOff_ = false;  // by the device
};

}  // namespace hapticd::device

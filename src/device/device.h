// The hand of the user, as every driver shows it. To write a driver, copy simulated/.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::device {

using base::Nanos;
using geometry::Quat;
using geometry::Vec3;

/// Reasons for the device not to take forces now, as bits.
enum Hold : std::uint32_t {
  kHoldNone = 0,
  kHoldNotCalibrated = 1U << 0,
  kHoldDeadMan = 1U << 1,  ///< presence or dead-man switch open
  kHoldInkwell = 1U << 2,  ///< stylus docked
  kHoldHot = 1U << 3,      ///< motor temperature over its limit
  kHoldFault = 1U << 4,    ///< the driver reports an error; faultText() has the words
};

/// What the device felt at one moment. Device frame: +x right, +y up, +z to the user.
struct DeviceState {
  Nanos time = 0;
  Vec3 position_m = Vec3::Zero();  ///< haptic interaction point (HIP)
  Quat orientation = Quat::Identity();
  Vec3 velocity_m_per_s = Vec3::Zero();
  Vec3 angularVelocity_rad_per_s = Vec3::Zero();
  std::uint32_t buttons = 0;  ///< bit i is button i
  std::uint32_t hold = kHoldNone;
  double motorTemperature = 0;             ///< 0 cold … 1 hot, worst motor
  std::optional<double> gripper_rad = {};  ///< how far the gripper is open; nothing without one
};

/// What the device can do, from the driver or, failing that, from a table.
struct DeviceProfile {
  std::string model = "simulated";
  geometry::Box workspace_m{Vec3(-0.080, -0.060, -0.035), Vec3(0.080, 0.060, 0.035)};
  double peakForce_N = 3.3;
  double continuousForce_N = 3.3;
  double nominalStiffness_N_per_m = 1000;
  double ownDamping_Ns_per_m = 5;  ///< device plus grip, for the passivity bound
  double transportDelay_s = 0;     ///< between read and write, for a child process or a network device
  int buttons = 2;
  std::uint32_t switches = kHoldNone;  ///< what it has a switch for: kHoldDeadMan, kHoldInkwell
  int inputDof = 6;                    ///< measured: 3 of the position, 3 of the orientation, 1 of a gripper
  int outputDof = 3;                   ///< with a motor, in the same order; only the force is rendered
  bool hasGripper = false;
  bool startsArmed = false;  ///< real devices wait for --enable-forces
};

/// One haptic device. open/close block and may throw; read/write run in the servo thread: noexcept,
/// non-blocking.
class Device {
 public:
  virtual ~Device() = default;
  Device() = default;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  /// Connects to the hardware. Throws std::runtime_error that says what is missing and how to get it.
  virtual void open() = 0;
  /// Leaves no force behind. May be called twice.
  virtual void close() noexcept = 0;

  /// Valid after open().
  virtual const DeviceProfile& profile() const noexcept = 0;

  /// The state at servo time `now`; false when there is none (`state` unchanged).
  virtual bool read(Nanos now, DeviceState& state) noexcept = 0;
  /// Commands a force in the device frame, in effect until the next write. While `hold` is set, the driver
  /// itself keeps the force at zero.
  virtual bool write(const Vec3& force_N) noexcept = 0;

  /// Why forces are held and what a person can do about it; empty when all is well. Any thread but the
  /// servo's.
  virtual std::string faultText() const { return {}; }
  /// True while nothing but close() and open() can bring the device back. Any thread but the servo's.
  virtual bool lost() const noexcept { return false; }
  /// A person's consent to calibrate now, where that moves the arm or needs it in a certain place; what it
  /// takes stands in faultText(). May block for seconds; forces are held meanwhile. Throws std::runtime_error
  /// when it does not succeed. Not in the servo thread.
  virtual void calibrate() {}

  /// True for a device that brings its own loop: instead of pacing it, call start().
  virtual bool selfPaced() const noexcept { return false; }
  /// Self-paced, after open(): calls `onTick` with the time of CLOCK_MONOTONIC once in each period, in a
  /// thread of the device; read() and write() are for that call alone. Throws std::runtime_error.
  virtual void start(std::function<void(Nanos)> /*onTick*/) {}
  /// Self-paced: returns after the last call, with zero force. close() does it, too. May be called twice.
  virtual void stop() noexcept {}
};

}  // namespace hapticd::device

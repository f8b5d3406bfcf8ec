// A haptic device, as every driver presents it. docs/writing-a-driver.md explains how to write one.
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
  kHoldFault = 1U << 4,    ///< the driver reports an error; faultText() explains it
};

/// The measured state at one moment. Device frame: +x right, +y up, +z to the user.
struct DeviceState {
  Nanos time = 0;
  Vec3 position_m = Vec3::Zero();  ///< haptic interaction point (HIP)
  Quat orientation = Quat::Identity();
  Vec3 velocity_m_per_s = Vec3::Zero();
  Vec3 angularVelocity_rad_per_s = Vec3::Zero();
  std::uint32_t buttons = 0;  ///< bit i is button i
  std::uint32_t hold = kHoldNone;
  double motorTemperature = 0;             ///< 0 cold … 1 hot, worst motor
  std::optional<double> gripper_rad = {};  ///< opening of the gripper; nothing without a gripper
};

/// What the device can do; the driver's own values win over the table in profiles.cpp.
struct DeviceProfile {
  std::string model = "simulated";
  geometry::Box workspace_m{Vec3(-0.080, -0.060, -0.035), Vec3(0.080, 0.060, 0.035)};
  double peakForce_N = 3.3;
  double continuousForce_N = 3.3;
  double nominalStiffness_N_per_m = 1000;
  double ownDamping_Ns_per_m = 5;  ///< device plus grip, for the passivity bound
  double transportDelay_s = 0;     ///< between read and write, for a child process or a network device
  int buttons = 2;
  std::uint32_t switches = kHoldNone;  ///< which of kHoldDeadMan, kHoldInkwell have a switch
  int inputDof = 6;                    ///< measured degrees of freedom: 3 position, 3 orientation, 1 gripper
  int outputDof = 3;  ///< degrees of freedom with a motor, in the same order; only the force is rendered
  bool hasGripper = false;
  bool startsArmed = false;  ///< real devices wait for --enable-forces
};

/// How a device has to be run.
struct DeviceTraits {
  /// The device brings its own loop: call start() instead of pacing it.
  bool selfPaced = false;
  /// Self-paced, in a thread that belongs to a vendor's library and keeps its scheduling.
  bool ticksInVendorThread = false;
  /// It calibrates itself in its loop, with the consent it was made with: no calibrate() after open().
  bool calibratesInLoop = false;
  /// A person must re-arm forces after a trip. False where there is no person to protect: the guard recovers
  /// by itself.
  bool needsRearm = true;
  /// The driver or the device ends a force by itself that no write followed for this long; 0: never. After
  /// such a pause the guard starts again from zero, as the motors do.
  Nanos forceLife = 0;
};

/// Of a driver's own thread that carries forces: just below the servo's, which must not wait for it. Without
/// realtime rights the thread has normal scheduling.
inline constexpr int kDriverPriority = 79;

class SteeredHand;

/// One haptic device. open/close block and may throw; read/write run in the servo thread: noexcept,
/// non-blocking.
class Device {
 public:
  virtual ~Device() = default;
  Device() = default;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  /// Connects to the hardware. Throws std::runtime_error: what is missing and how to get it.
  virtual void open() = 0;
  /// Leaves no force behind. May be called twice.
  virtual void close() noexcept = 0;

  /// Valid after open().
  virtual const DeviceProfile& profile() const noexcept = 0;
  /// Valid after open(); selfPaced before, too.
  virtual DeviceTraits traits() const noexcept { return {}; }
  /// The controls of a hand that no person moves; null for all other devices.
  virtual SteeredHand* steered() noexcept { return nullptr; }

  /// The state at servo time `now`; false when there is none (`state` unchanged).
  virtual bool read(Nanos now, DeviceState& state) noexcept = 0;
  /// Commands a force in the device frame, in effect until the next write. While `hold` is set, the driver
  /// itself keeps the force at zero.
  virtual bool write(const Vec3& force_N) noexcept = 0;
  /// In the servo thread, after a write of zero: none that was written before it can act any more, also if
  /// all threads of this process stop now. A driver that sends in a thread of its own tells when that has
  /// sent.
  virtual bool zeroSent() const noexcept { return true; }
  /// Ends the force while the servo thread may be stuck in, or run, read() and write(); no force that was
  /// written before this call acts after it. False where the driver cannot: such a device ends forces that
  /// nobody renews by itself, or its driver runs isolated. Between start and stop of the loop, from one
  /// thread besides the servo's; noexcept, non-blocking.
  virtual bool zeroFromOtherThread() noexcept { return false; }

  /// Why forces are held and what a person can do about it; empty when all is well. Any thread but the
  /// servo's.
  virtual std::string faultText() const { return {}; }
  /// True while nothing but close() and open() can bring the device back. Any thread but the servo's.
  virtual bool lost() const noexcept { return false; }
  /// A person consents to calibrate now, which may move the arm or require a certain pose; faultText()
  /// explains what is needed. May block for seconds; forces are held meanwhile. `stopped` becomes true when a
  /// person stops the forces, or did so before, or the device is about to be closed: the calibration then
  /// ends within some milliseconds or does not begin. Throws std::runtime_error when it did not succeed, and
  /// the arm is without force then. Not in the servo thread.
  virtual void calibrate(const std::function<bool()>& /*stopped*/) {}
  /// The same where nobody can stop it.
  void calibrate() {
    calibrate([] { return false; });
  }
  /// The device is about to be closed for good: where the driver can, an open() that runs in another thread,
  /// or begins later, throws soon. Any thread; non-blocking.
  virtual void interrupt() noexcept {}

  /// Self-paced, after open(): calls `onTick` with the time of CLOCK_MONOTONIC once per period, in a thread
  /// of the device; only that call may use read() and write(). Throws std::runtime_error.
  virtual void start(std::function<void(Nanos)> /*onTick*/) {}
  /// Self-paced: returns after the last call, with zero force. close() calls it, too. May be called twice.
  virtual void stop() noexcept {}
};

}  // namespace hapticd::device

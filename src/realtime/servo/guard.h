// The last thing before the device: no rendered force reaches a hand without passing here.
//
// In this order: finite check, blend after a jump of geometry, clamp to the peak force (direction kept)
// within the thermal budget, slew limit, gain. The gain is zero while anything holds the force, falls over 20
// ms after a late tick, and rises over 0.5 s after every pause. All laws are in seconds, so they are the same
// at 250 Hz and 4 kHz; only the speed trip counts ticks.
#pragma once

#include <array>

#include "device/device.h"
#include "realtime/servo/guard_control.h"
#include "realtime/servo/thermal_budget.h"
#include "realtime/servo/trips.h"

namespace hapticd::realtime {

using geometry::Vec3;

/// Limits of one device and choices of the operator.
struct GuardOptions {
  bool enabled = true;       ///< false passes finite forces as they are (`render --raw`)
  bool selfRecover = false;  ///< latched speed and stall trips end by themselves: for simulated hands alone
  bool armed = false;        ///< forces allowed from the start
  double peakForce_N = 3.3;
  double continuousForce_N = 3.3;
  double slew_N_per_s = 1000;
  double speed_m_per_s = 1.2;
  int speedTicks = 3;
  double calmSpeed_m_per_s = 0.3;  ///< a speed trip ends below
  Nanos rampIn = 500'000'000;
  Nanos late = 3'000'000;
  Nanos lateDecay = 20'000'000;
  Nanos stalled = 50'000'000;
  Nanos blend = 20'000'000;

  /// The limits of a device, armed as its profile says.
  static GuardOptions of(const device::DeviceProfile& profile) {
    GuardOptions options;
    options.armed = profile.startsArmed;
    options.peakForce_N = profile.peakForce_N;
    options.continuousForce_N = profile.continuousForce_N;
    return options;
  }
};

/// What the guard did in a tick, and what it has done so far.
struct GuardReport {
  std::uint32_t active = 0;                        ///< bit(Trip): acting in this tick
  std::uint32_t latched = 0;                       ///< faults that wait for a re-arm
  std::array<std::uint32_t, kTripCount> counts{};  ///< how often each began
  double gain = 0;                                 ///< 0…1
  double limit_N = 0;                              ///< peak force less what the thermal budget takes
  bool armed = false;
  bool stopped = false;
};

/// One tick as the guard sees it.
struct GuardInput {
  Vec3 force_N = Vec3::Zero();                 ///< as rendered
  const device::DeviceState* state = nullptr;  ///< null when the device gave none
  Nanos period = 0;                            ///< since the tick before; 0 in the first
  Nanos late = 0;                              ///< start of this tick less when it was due
  bool writeFailed = false;                    ///< the device refused the force of the tick before
  bool geometryJump = false;
  bool deepContact = false;
};

/// step() belongs to the servo thread: noexcept, no allocation, no lock.
class Guard {
 public:
  /// `control` must outlive the guard. `nominalPeriod` bounds what one late tick may add to a ramp.
  Guard(const GuardOptions& options, const GuardControl& control, Nanos nominalPeriod) noexcept;

  /// The force to write.
  Vec3 step(const GuardInput& in) noexcept;
  const GuardReport& report() const noexcept { return report_; }
  /// What the control said in the last step.
  const GuardControl::Seen& seen() const noexcept { return seen_; }

 private:
  void obeyControl() noexcept;
  void checkDevice(const GuardInput& in) noexcept;
  void checkSpeed(const device::DeviceState& state) noexcept;
  void checkTime(const GuardInput& in) noexcept;
  Vec3 finite(const Vec3& force) noexcept;
  Vec3 blended(const Vec3& force, bool jump, Nanos dt) noexcept;
  Vec3 clamped(const Vec3& force) noexcept;
  Vec3 slewLimited(const Vec3& force, Nanos dt) noexcept;
  double gain(Nanos dt) noexcept;
  void note(Trip trip, bool acts = true) noexcept { now_ |= acts ? bit(trip) : 0; }
  void latch(Trip trip) noexcept { report_.latched |= bit(trip); }
  void count() noexcept;

  enum class Phase { zero, rampIn, decay };

  GuardOptions options_;
  const GuardControl& control_;
  Nanos longestStep_;
  ThermalBudget budget_;
  GuardReport report_;
  std::uint32_t now_ = 0;  // bits of this tick
  GuardControl::Seen seen_;
  bool restart_ = false;  // ramp in anew

  int fastTicks_ = 0;
  bool waitForCalm_ = false;

  Vec3 shaped_ = Vec3::Zero();  // after the slew limit, before the gain
  Vec3 blendFrom_ = Vec3::Zero();
  Nanos blended_;  // since the last jump
  Phase phase_ = Phase::zero;
  Nanos inPhase_ = 0;
  double decayFrom_ = 0;
};

}  // namespace hapticd::realtime

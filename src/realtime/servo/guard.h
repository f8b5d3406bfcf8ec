// The last stage before the device: every rendered force passes the guard.
//
// In this order: finite check, blend after a change by a command, clamp to the peak force (direction kept)
// and to the thermal budget, gain, slew limit (force_rate.h). The gain is zero while a trip holds the force,
// falls over 20 ms after a late tick, and rises over 0.5 s after every pause. All laws are in seconds, hence
// the same at 250 Hz and 4 kHz; only the speed trip counts ticks.
#pragma once

#include <array>

#include "device/device.h"
#include "realtime/servo/guard_control.h"
#include "realtime/servo/thermal_budget.h"
#include "realtime/servo/trips.h"

namespace hapticd::realtime {

using geometry::Vec3;

/// Limits of one device and options of the operator.
struct GuardOptions {
  bool enabled = true;       ///< false: finite forces pass unchanged (`render --raw`)
  bool selfRecover = false;  ///< latched speed and stall trips end by themselves; simulated hands only
  bool armed = false;        ///< forces are allowed from the start
  double peakForce_N = 3.3;
  double continuousForce_N = 3.3;
  double slew_N_per_s = 1000;
  double speed_m_per_s = 1.2;
  int speedTicks = 3;
  double calmSpeed_m_per_s = 0.3;  ///< a speed trip ends below this speed
  Nanos rampIn = 500'000'000;
  Nanos late = 3'000'000;
  Nanos lateDecay = 20'000'000;
  Nanos stalled = 50'000'000;
  Nanos blend = 20'000'000;

  /// The limits and the arming of a device profile.
  static GuardOptions of(const device::DeviceProfile& profile) {
    GuardOptions options;
    options.armed = profile.startsArmed;
    options.peakForce_N = profile.peakForce_N;
    options.continuousForce_N = profile.continuousForce_N;
    return options;
  }
};

/// What the guard did in a tick, and totals.
struct GuardReport {
  std::uint32_t active = 0;                        ///< bit(Trip): trips that act in this tick
  std::uint32_t latched = 0;                       ///< latched trips that wait for a re-arm
  std::array<std::uint32_t, kTripCount> counts{};  ///< how often each trip began
  double gain = 0;                                 ///< 0…1
  double limit_N = 0;                              ///< peak force, or less by the thermal budget
  bool armed = false;
  bool stopped = false;
};

/// The input of one tick.
struct GuardInput {
  Vec3 force_N = Vec3::Zero();                 ///< rendered force
  const device::DeviceState* state = nullptr;  ///< null when the device delivered none
  Nanos period = 0;                            ///< since the previous tick; 0 in the first
  Nanos late = 0;                              ///< start of this tick minus its deadline
  bool writeFailed = false;                    ///< the device refused the previous force
  bool forceEnded = false;                     ///< the device ended the previous force by itself
  bool notFinite = false;                      ///< the renderer met a value that is not: its force is zero
  bool geometryJump = false;                   ///< geometry or surface in contact changed at once
  bool deepContact = false;
};

/// What a guard at rest knows of earlier ticks, besides its report and the force that it wrote. A plain
/// value.
struct GuardMemory {
  Vec3 shaped_N = Vec3::Zero();  ///< the force before the gain
  bool waitForCalm = false;      ///< a speed trip acts until the device is slow
  ThermalMemory thermal;
};

/// One per servo, called by its thread: noexcept, no allocation, no lock.
class Guard {
 public:
  /// `control` must outlive the guard. `nominalPeriod` limits what one late tick may add to a ramp.
  Guard(const GuardOptions& options, const GuardControl& control, Nanos nominalPeriod) noexcept;

  /// The force to write, device frame, newtons.
  Vec3 step(const GuardInput& in) noexcept;
  /// The force of the last step came too late and zero was written instead: counts as a late tick, and forces
  /// ramp in.
  void discardForce() noexcept;
  const GuardReport& report() const noexcept { return report_; }
  /// Continues after a step that reported this and wrote this force, as far as that tells.
  void resume(const GuardReport& report, const Vec3& written_N) noexcept;
  /// What resume() needs as well; false while the guard is not at rest: in a ramp, a decay or a blend.
  bool remember(GuardMemory& out) const noexcept;
  void resume(const GuardMemory& memory) noexcept;
  /// The state of the control in the last step.
  const GuardControl::Seen& seen() const noexcept { return seen_; }

 private:
  void obeyControl() noexcept;
  void checkDevice(const GuardInput& in) noexcept;
  void checkSpeed(const device::DeviceState& state) noexcept;
  void checkTime(const GuardInput& in) noexcept;
  Vec3 finite(const Vec3& force) noexcept;
  Vec3 blended(const Vec3& force, bool jump, Nanos dt) noexcept;
  Vec3 clamped(const Vec3& force) noexcept;
  void limitSlew(Nanos dt) noexcept;
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
  std::uint32_t now_ = 0;  // trips of this tick
  GuardControl::Seen seen_;
  bool restart_ = false;  // the ramp starts again
  bool overdue_ = false;  // nothing is left to decay from

  int fastTicks_ = 0;
  bool waitForCalm_ = false;

  Vec3 shaped_ = Vec3::Zero();     // force before the gain
  Vec3 written_ = Vec3::Zero();    // by the last step
  Vec3 blendStep_ = Vec3::Zero();  // from the force after the last jump to the one before it
  double blendMost_N_ = 0;         // the size of the one before it
  Nanos blended_;                  // since the last jump
  Nanos blendTime_;                // of that jump
  Phase phase_ = Phase::zero;
  Nanos inPhase_ = 0;
  double decayFrom_ = 0;
};

}  // namespace hapticd::realtime

#include "realtime/servo/guard.h"

#include <algorithm>
#include <cmath>

#include "base/time.h"
#include "realtime/servo/force_rate.h"

namespace hapticd::realtime {
namespace {

constexpr std::uint32_t kZeroing =
    (tripsOf(TripAction::hold) | tripsOf(TripAction::latch)) & ~bit(Trip::late);
constexpr double kRounding = 1e-12;  // relative: a force on the limit does not exceed it

double share(Nanos elapsed, Nanos whole) noexcept {
  return elapsed >= whole ? 1.0 : static_cast<double>(elapsed) / static_cast<double>(whole);
}

}  // namespace

Guard::Guard(const GuardOptions& options, const GuardControl& control, Nanos nominalPeriod) noexcept
    : options_(options),
      control_(control),
      longestStep_(2 * nominalPeriod),
      budget_(options.peakForce_N, options.continuousForce_N),
      seen_(control.read()),
      blended_(options.blend),
      blendTime_(options.blend) {}

Vec3 Guard::step(const GuardInput& in) noexcept {
  now_ = 0;
  const Vec3 rendered = finite(in.force_N);
  note(Trip::notFinite, in.notFinite);
  if (!options_.enabled) {
    count();
    report_.gain = 1;
    return rendered;
  }
  // A late tick may raise a force or a ramp by no more than two ticks on time.
  const Nanos dt = std::clamp<Nanos>(in.period, 0, longestStep_);
  budget_.add(written_.norm(), in.period);
  if (in.forceEnded) written_.setZero();

  obeyControl();
  checkDevice(in);
  checkTime(in);
  note(Trip::deepContact, in.deepContact);

  shaped_ = clamped(blended(rendered, in.geometryJump, dt));
  report_.gain = gain(dt);
  limitSlew(dt);
  report_.limit_N = budget_.limit_N();
  count();
  return written_;
}

void Guard::discardForce() noexcept {
  if (!options_.enabled) return;
  const std::uint32_t late = bit(Trip::late);
  if ((report_.active & late) == 0) ++report_.counts[static_cast<std::size_t>(Trip::late)];
  report_.active |= late;
  report_.gain = 0;
  phase_ = Phase::zero;
  shaped_.setZero();
  written_.setZero();
}

void Guard::resume(const GuardReport& report, const Vec3& written_N) noexcept {
  report_ = report;
  written_ = written_N;
  shaped_ = report.gain > 0 ? Vec3(written_N / report.gain) : Vec3::Zero();
  phase_ = report.gain > 0 ? Phase::rampIn : Phase::zero;
  inPhase_ = static_cast<Nanos>(std::llround(report.gain * static_cast<double>(options_.rampIn)));
  waitForCalm_ = (report.active & bit(Trip::speed)) != 0;
}

bool Guard::remember(GuardMemory& out) const noexcept {
  out = {shaped_, waitForCalm_, budget_.memory()};
  const bool steady = phase_ == Phase::zero || (phase_ == Phase::rampIn && report_.gain == 1);
  return !options_.enabled || (steady && blended_ >= blendTime_ && fastTicks_ == 0);
}

void Guard::resume(const GuardMemory& memory) noexcept {
  shaped_ = memory.shaped_N;
  waitForCalm_ = memory.waitForCalm;
  budget_.resume(memory.thermal);
  blended_ = blendTime_;
  fastTicks_ = 0;
}

void Guard::obeyControl() noexcept {
  const GuardControl::Seen seen = control_.read();
  restart_ = seen.ramps != seen_.ramps || seen.rearms != seen_.rearms;
  if (seen.rearms != seen_.rearms) report_.latched = 0;
  seen_ = seen;
  report_.stopped = seen.stopped;
  report_.armed = seen.armed;
  note(Trip::stopped, seen.stopped);
  note(Trip::disarmed, !seen.armed);
}

void Guard::checkDevice(const GuardInput& in) noexcept {
  note(Trip::noState, in.state == nullptr || in.writeFailed);
  if (in.state == nullptr) return;
  const std::uint32_t hold = in.state->hold;
  note(Trip::notCalibrated, (hold & device::kHoldNotCalibrated) != 0);
  note(Trip::deadMan, (hold & device::kHoldDeadMan) != 0);
  note(Trip::inkwell, (hold & device::kHoldInkwell) != 0);
  note(Trip::hot, (hold & device::kHoldHot) != 0);
  if ((hold & device::kHoldFault) != 0) latch(Trip::deviceFault);
  note(Trip::notFinite, !in.state->position_m.allFinite() || !in.state->velocity_m_per_s.allFinite());
  checkSpeed(*in.state);
}

void Guard::checkSpeed(const device::DeviceState& state) noexcept {
  const double speed = state.velocity_m_per_s.norm();
  fastTicks_ = speed > options_.speed_m_per_s ? std::min(fastTicks_ + 1, options_.speedTicks) : 0;
  if (fastTicks_ == options_.speedTicks) {
    latch(Trip::speed);
    waitForCalm_ = true;
  }
  // Nobody knows how a faulty device moves; a hand that is out of sight counts as at rest.
  const bool known = (state.hold & device::kHoldFault) == 0;
  if (known && speed < options_.calmSpeed_m_per_s && waitForCalm_) {
    waitForCalm_ = false;
    if (options_.selfRecover) report_.latched &= ~bit(Trip::speed);
  }
  note(Trip::speed, waitForCalm_);  // a re-arm has no effect until the device is slow again
}

void Guard::checkTime(const GuardInput& in) noexcept {
  note(Trip::late, in.late > options_.late || in.forceEnded);
  overdue_ = in.late > options_.lateDecay || in.forceEnded;  // the decay would have ended by now
  if (in.late > options_.stalled) {
    latch(Trip::stalled);
  } else if (options_.selfRecover && in.late <= options_.late) {
    report_.latched &= ~bit(Trip::stalled);
  }
}

Vec3 Guard::finite(const Vec3& force) noexcept {
  if (force.allFinite()) return force;
  note(Trip::notFinite);
  return Vec3::Zero();
}

// The step fades, within the slew rate also when the device is strong, and the force goes on: one that was
// held back would be late, as in a loop with a delay, which shakes. It may return by itself meanwhile.
// The blend advances in its first tick, so that the force still follows geometry that jumps in every tick.
Vec3 Guard::blended(const Vec3& force, bool jump, Nanos dt) noexcept {
  if (jump) {
    blendStep_ = shaped_ - force;
    blendMost_N_ = shaped_.norm();
    blended_ = 0;
    const double change_N = std::min(blendStep_.norm(), 2 * options_.peakForce_N);
    blendTime_ = std::max(options_.blend, base::toNanos(change_N / options_.slew_N_per_s));
    note(Trip::geometryJump);
  }
  if (blended_ >= blendTime_) return force;
  blended_ += dt;
  const Vec3 faded = force + (1 - share(blended_, blendTime_)) * blendStep_;
  return faded * std::min(1.0, std::max(force.norm(), blendMost_N_) / std::max(faded.norm(), 1e-300));
}

Vec3 Guard::clamped(const Vec3& force) noexcept {
  const double size = force.norm();
  const double limit = std::min(options_.peakForce_N, budget_.limit_N());
  note(Trip::peakForce, size > options_.peakForce_N * (1 + kRounding));
  note(Trip::thermal, limit < options_.peakForce_N && size > limit * (1 + kRounding));
  if (size <= limit) return force;
  // A huge finite force may have an infinite norm: scale it down first.
  const double largest = force.cwiseAbs().maxCoeff();
  return limit * (force / largest).normalized();
}

// A blend starts from the force that was written: a limited one replaces the force before the gain.
void Guard::limitSlew(Nanos dt) noexcept {
  const Vec3 wanted = report_.gain * shaped_;
  const Vec3 allowed = withinForceRate(written_, wanted, options_.slew_N_per_s * base::toSeconds(dt));
  if (allowed != wanted) {
    note(Trip::slew);
    shaped_ = allowed / report_.gain;
  }
  written_ = allowed;
}

double Guard::gain(Nanos dt) noexcept {
  if (((now_ | report_.latched) & kZeroing) != 0 || overdue_) {
    phase_ = Phase::zero;
    return 0;
  }
  if (phase_ == Phase::zero || restart_) {
    phase_ = Phase::rampIn;
    inPhase_ = 0;
  } else {
    inPhase_ += dt;
  }
  if ((now_ & bit(Trip::late)) != 0 && phase_ == Phase::rampIn) {
    decayFrom_ = report_.gain;
    phase_ = Phase::decay;
    inPhase_ = 0;
  }
  if (phase_ == Phase::decay) {
    if (inPhase_ < options_.lateDecay) return decayFrom_ * (1 - share(inPhase_, options_.lateDecay));
    phase_ = Phase::rampIn;
    inPhase_ = 0;
  }
  return share(inPhase_, options_.rampIn);
}

void Guard::count() noexcept {
  const std::uint32_t acting = now_ | report_.latched;
  const std::uint32_t began = acting & ~report_.active;
  for (std::size_t i = 0; i < kTripCount; ++i) {
    report_.counts[i] += (began >> i) & 1U;
  }
  report_.active = acting;
}

}  // namespace hapticd::realtime

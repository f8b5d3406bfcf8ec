#include "sim/judge.h"

#include <algorithm>
#include <cstdio>

namespace hapticd::sim {
namespace {

std::string ms(Nanos t) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3f ms", static_cast<double>(t) * 1e-6);
  return text;
}

// Of `force` from the nearest point between zero and `last`: a force may fall at any rate, and grow or turn
// at a limited one.
double growth_N(const Vec3& last, const Vec3& force) {
  const double length2 = last.squaredNorm();
  const double share = length2 > 0 ? std::clamp(force.dot(last) / length2, 0.0, 1.0) : 0.0;
  return (force - share * last).norm();
}

}  // namespace

void Judge::latch(const std::string& why) {
  if (!latched_) ++latches_;
  latched_ = true;
  latchedAt_ = started_;
  latchReason_ = why;
}

void Judge::onRead(Nanos now, Nanos clock, bool delivered, const device::DeviceState& state) {
  const Nanos late = first_ ? 0 : now - tick_ - limits_.period;
  first_ = false;
  gap_ = late + limits_.period;
  if (late > limits_.late) stalled_ += late;
  tick_ = now;
  started_ = clock;
  pending_ = true;
  ++ticks_;

  // A re-arm that the server read after a stop or a fault may end it.
  if (stopped_ && rearmed_ > stoppedAt_) stopped_ = false;
  if (latched_ && rearmed_ > latchedAt_) latched_ = false;
  constexpr Nanos kSuspensionSeen = 100'000'000;
  if (suspended_ && clock - *suspended_ > kSuspensionSeen) {
    if (rearmed_ <= *suspended_) stopped_ = true, stoppedAt_ = *suspended_;
    suspended_.reset();
  }
  for (const Nanos stop : stops_) {
    if (rearmed_ <= stop) stopped_ = true, stoppedAt_ = std::max(stoppedAt_, stop);
  }
  stops_.clear();

  holdReason_.clear();
  if (refused_) holdReason_ = "the device refused the force before";
  if (late > limits_.late) holdReason_ = "the tick was " + ms(late) + " late";
  if (late > limits_.stalled) latch("a tick was " + ms(late) + " late");
  if (!delivered) {
    holdReason_ = "the device delivered no state";
    return;
  }
  position_m_ = state.position_m;
  if (!state.position_m.allFinite() || !state.velocity_m_per_s.allFinite())
    holdReason_ = "the position is not finite";
  if (state.hold != device::kHoldNone) holdReason_ = "the device holds the force";
  if ((state.hold & device::kHoldFault) != 0) latch("a fault of the device");
  const double speed = state.velocity_m_per_s.norm();
  fast_ = speed > limits_.speed_m_per_s ? fast_ + 1 : 0;
  if (fast_ >= limits_.speedTicks) {
    latch("the hand was too fast");
    waitForCalm_ = true;
  }
  // Nobody knows how a faulty device moves.
  const bool known = (state.hold & device::kHoldFault) == 0;
  if (known && speed < limits_.calmSpeed_m_per_s) waitForCalm_ = false;
  if (waitForCalm_) holdReason_ = "the hand is too fast";
}

void Judge::fail(Nanos clock, const std::string& text, const Vec3& force_N) {
  char numbers[96];
  std::snprintf(numbers, sizeof numbers, " force %.6f %.6f %.6f N", force_N.x(), force_N.y(), force_N.z());
  knows_.finding("at " + ms(clock) + ": " + text + ";" + numbers);
}

void Judge::onWrite(Nanos clock, const Vec3& force_N, bool accepted) {
  constexpr double kRounding = 1e-9;
  refused_ = !accepted;
  const bool inTick = std::exchange(pending_, false);
  const double size_N = force_N.norm();
  if (!force_N.allFinite()) fail(clock, "a force that is not finite", force_N);
  if (size_N > limits_.peak_N * (1 + kRounding)) fail(clock, "above the peak force", force_N);
  if (!inTick && size_N > 0) fail(clock, "a force outside of a tick", force_N);
  if (inTick && clock - started_ > limits_.oldest) holdReason_ = "the tick took " + ms(clock - started_);

  const char* const until = " and nobody has re-armed since";
  if (size_N > 0) {
    ++withForce_;
    if (!holdReason_.empty()) fail(clock, "a force although " + holdReason_, force_N);
    if (stopped_) fail(clock, "a force after a stop at " + ms(stoppedAt_) + until, force_N);
    if (latched_) fail(clock, "a force after " + latchReason_ + " at " + ms(latchedAt_) + until, force_N);
    // Nobody is left who may want a force.
    const auto freeFrom = knows_.freeFrom();
    if (freeFrom && clock > *freeFrom && size_N > 1e-6)
      fail(clock, "a force that outlives its client, which should have ended at " + ms(*freeFrom), force_N);
  }
  if (held()) zeroAt_ = tick_;
  const double ramp =
      static_cast<double>(tick_ - zeroAt_ + 2 * limits_.period) / static_cast<double>(limits_.rampIn);
  if (size_N > limits_.peak_N * std::min(1.0, ramp) + kRounding)
    fail(clock, "above the ramp " + ms(tick_ - zeroAt_) + " after a pause", force_N);
  const double step_N = limits_.slew_N_per_s * static_cast<double>(2 * limits_.period) * 1e-9;
  if (growth_N(written_N_, force_N) > step_N + kRounding) fail(clock, "grows or turns too fast", force_N);
  written_N_ = force_N;

  // After the ramp a hand that is inside must be pushed out; a few ticks belong to geometry on its way.
  constexpr double kDeep_m = 0.0015;
  constexpr int kMostTicks = 40;
  const std::optional<Top> top = knows_.top();
  const double lowest_m = top ? top->lowest_m : 0;
  // A re-arm begins a ramp, also when nothing was off.
  const bool ramped = tick_ - std::max(zeroAt_, rearmed_) > limits_.rampIn + 20'000'000;
  // Without a force nothing keeps the hand from where an object may release it. A hand that leaps beside the
  // cube is held by its side when it comes back.
  constexpr double kRim_m = 0.0005;
  const double beside_m = std::max(std::abs(position_m_.x()), std::abs(position_m_.z()));
  if (!top || held() || suspended_ || gap_ > 3 * limits_.period || beside_m > top->halfWidth_m - kRim_m) {
    outside_ = false;
  } else if (position_m_.y() > top->highest_m + 0.002) {
    outside_ = true;
  }
  const bool deep = inTick && outside_ && position_m_.y() < lowest_m - kDeep_m;
  if (deep) ++inside_;
  deep_ = deep && ramped && force_N.y() < 0.05 ? deep_ + 1 : 0;
  if (deep_ == kMostTicks)
    fail(clock,
         "an object has swallowed the hand, " + std::to_string(1000 * (lowest_m - position_m_.y())) +
             " mm below its top",
         force_N);
}

}  // namespace hapticd::sim

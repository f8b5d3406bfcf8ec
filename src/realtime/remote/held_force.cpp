#include "realtime/remote/held_force.h"

#include "base/time.h"
#include "realtime/remote/at_most.h"

namespace hapticd::realtime {
namespace {

constexpr double kCutTime_s = 0.008;  // an empty tank cuts within 10 ms
constexpr double kResume_J = 0.002;   // a cut ends at this content, so that it does not chatter
constexpr double kFadeShare = 0.9;    // of the slew rate: the fade ends before the life does
constexpr double kStill_m_per_s = 1e-6;

}  // namespace

void HeldForceLaw::reset() noexcept {
  force_N_.setZero();
  cut_ = 0;
}

void HeldForceLaw::restart(const Vec3& hip_m) noexcept {
  reset();
  lastHip_m_ = hip_m;
}

bool HeldForceLaw::remember(RemoteMemory& out) const noexcept {
  out.started = started_;
  out.budget = tank_.budget();
  out.energy_J = tank_.balance_J();
  out.spent = spent_;
  out.cut = cut_;
  return force_N_.isZero(0);
}

void HeldForceLaw::resume(const RemoteMemory& memory, const Vec3& hip_m) noexcept {
  restart(hip_m);
  tank_ = EnergyTank(memory.budget, memory.energy_J);
  started_ = memory.started;
  spent_ = memory.spent;
  cut_ = memory.cut;
}

// Falls early enough to be zero at the end at the allowed rate.
Vec3 HeldForceLaw::target(const HeldForce& wanted, Nanos now) const noexcept {
  const Nanos left = wanted.number == 0 ? 0 : wanted.received + wanted.lifetime - now;
  if (left <= 0) return Vec3::Zero();
  return atMost(wanted.force_N, kFadeShare * kRemoteRate_N_per_s * base::toSeconds(left));
}

// Cuts the part along the velocity when the tank is empty; the part that brakes or guides stays.
Vec3 HeldForceLaw::withinEnergy(const Vec3& force_N, const Vec3& velocity_m_per_s, double step_s) noexcept {
  if (tank_.energy_J() >= std::min(kResume_J, tank_.budget().capacity_J)) spent_ = false;
  cut_ = std::clamp(cut_ + (spent_ ? step_s : -step_s) / kCutTime_s, 0.0, 1.0);
  const double speed = velocity_m_per_s.norm();
  const double power = force_N.dot(velocity_m_per_s);
  if (cut_ <= 0 || power <= 0 || speed < kStill_m_per_s) return force_N;
  return force_N - cut_ * power / (speed * speed) * velocity_m_per_s;
}

void HeldForceLaw::step(const HeldForce& wanted, const Vec3& hip_m, const Vec3& velocity_m_per_s, Nanos now,
                        double step_s, double passedShare, RemoteRendering& out) noexcept {
  if (wanted.number != 0) {
    if (!started_) tank_ = EnergyTank(wanted.budget);
    started_ = true;
    tank_.setBudget(wanted.budget);
  }
  const double work = force_N_.dot(hip_m - lastHip_m_);
  lastHip_m_ = hip_m;
  tank_.give(work > 0 ? work : work * passedShare);
  if (tank_.energy_J() <= 0) spent_ = true;
  tank_.refill(step_s);

  const Vec3 goal = withinEnergy(target(wanted, now), velocity_m_per_s, step_s);
  const double cutRate = cut_ > 0 ? force_N_.norm() / kCutTime_s : 0;
  force_N_ += atMost(goal - force_N_, std::max(kRemoteRate_N_per_s, cutRate) * step_s);
  out.heldForce_N = force_N_;
  out.energy_J = tank_.energy_J();
  out.forceTime = wanted.clientTime;
  if (cut_ > 0 && !target(wanted, now).isZero(0)) out.status |= kRemoteEnergySpent;
}

}  // namespace hapticd::realtime

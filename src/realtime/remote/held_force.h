// The law of held forces: slew-limited, zero at the end of their life, and within a budget of energy, so that
// a delayed loop cannot pump the arm.
#pragma once

#include "realtime/remote/energy_tank.h"
#include "realtime/remote/remote_memory.h"
#include "realtime/remote/remote_report.h"

namespace hapticd::realtime {

/// One per servo, called in its thread: noexcept, no allocation.
class HeldForceLaw {
 public:
  /// The force of this tick, also in `out`. `passedShare`: 0 … 1, of the force of the last tick, by the
  /// guard: a force that was not written returns no energy.
  void step(const HeldForce& wanted, const Vec3& hip_m, const Vec3& velocity_m_per_s, Nanos now,
            double step_s, double passedShare, RemoteRendering& out) noexcept;
  void reset() noexcept;
  /// The hand may be anywhere, now here: no force pushed it there, and a force ramps in.
  void restart(const Vec3& hip_m) noexcept;
  /// What a later force depends on, unless a force acts: then false.
  bool remember(RemoteMemory& out) const noexcept;
  /// Continues from a tick without a force, with the hand at `hip_m`.
  void resume(const RemoteMemory& memory, const Vec3& hip_m) noexcept;

 private:
  Vec3 target(const HeldForce& wanted, Nanos now) const noexcept;
  Vec3 withinEnergy(const Vec3& force_N, const Vec3& velocity_m_per_s, double step_s) noexcept;

  EnergyTank tank_{EnergyBudget{}};
  bool started_ = false;  // the tank has its first budget
  bool spent_ = false;
  double cut_ = 0;  // share of the adding part that is cut
  Vec3 force_N_ = Vec3::Zero();
  Vec3 lastHip_m_ = Vec3::Zero();
};

}  // namespace hapticd::realtime

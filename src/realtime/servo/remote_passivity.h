// Keeps what clients stream as passive as the scene's own surfaces: remote contacts grow no faster than the
// guard lets them, and an arm that nobody holds comes to rest on those that rest.
#pragma once

#include "realtime/remote/remote_contacts.h"
#include "realtime/render/passivity_controller.h"
#include "realtime/render/rise_limit.h"

namespace hapticd::realtime {

/// One per servo, called in its thread: noexcept, no allocation.
class RemotePassivity {
 public:
  /// `rise_N_per_s` and `bareDamping_Ns_per_m` as in RenderOptions.
  RemotePassivity(double rise_N_per_s, double bareDamping_Ns_per_m) noexcept
      : rise_(rise_N_per_s), controller_(bareDamping_Ns_per_m) {}

  void reset() noexcept;
  /// Begins in free space.
  void resume(const Vec3& hip_m) noexcept { controller_.resume(hip_m); }
  /// Without contacts: the state is that after resume().
  bool isEven() const noexcept { return controller_.isEven(); }
  /// One tick, after that of the contacts, beside a contact force of the scene: lowers their forces in `out`,
  /// and adds the brake to their sum.
  void step(const RemoteContacts& contacts, const Vec3& scene_N, const Vec3& hip_m, double period_s,
            RemoteRendering& out) noexcept;
  /// A tick without any.
  void idle(const Vec3& scene_N) noexcept { rise_.acts(scene_N); }

 private:
  RiseLimit rise_;
  PassivityController controller_;
};

}  // namespace hapticd::realtime

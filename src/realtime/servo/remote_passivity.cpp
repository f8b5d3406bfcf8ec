#include "realtime/servo/remote_passivity.h"

#include <algorithm>

namespace hapticd::realtime {
namespace {

constexpr double kShortestPeriod_s = 1e-5;  // keeps speeds finite when a time stamp repeats

void scale(double share, RemoteRendering& out) noexcept {
  if (share == 1) return;
  out.contactForce_N *= share;
  for (std::uint32_t i = 0; i < out.count; ++i) out.contacts[i].force_N *= static_cast<float>(share);
}

SpringState stateOf(const RemoteContacts& contacts) noexcept {
  const RemoteSprings springs = contacts.springs();
  SpringState state;
  state.known = contacts.rest();
  state.force_N = springs.force_N;
  state.normal = springs.normal_N.stableNormalized();
  state.stored_J = springs.stored_J;
  state.stiffness_N_per_m = springs.stiffest_N_per_m;
  state.beside = springs.beside;
  return state;
}

}  // namespace

void RemotePassivity::reset() noexcept {
  rise_.reset();
  controller_.reset();
}

void RemotePassivity::step(const RemoteContacts& contacts, const Vec3& scene_N, const Vec3& hip_m,
                           double period_s, RemoteRendering& out) noexcept {
  period_s = std::max(period_s, kShortestPeriod_s);
  const double share = rise_.step(out.contactForce_N, contacts.rest(), period_s, scene_N);
  scale(share, out);
  if (controller_.helps()) {
    SpringState springs = stateOf(contacts);
    springs.scale(share);
    springs.pressed_N = out.contactForce_N.dot(springs.normal);
    springs.most_N = rise_.most_N();
    out.contactForce_N += controller_.step(springs, hip_m, period_s);
  }
  rise_.acts(scene_N + out.contactForce_N);
}

}  // namespace hapticd::realtime

// How contacts that overlap share the normal force.
#pragma once

#include <array>
#include <cstddef>

#include "realtime/remote/remote_input.h"

namespace hapticd::realtime {

/// Contacts that press in one tick. Plain arrays: the solver walks along them.
struct PressingContacts {
  static constexpr std::size_t kMost = 2 * kMaxRemoteContacts;

  std::size_t count = 0;
  std::array<double, kMost> x, y, z;   ///< normals, unit
  std::array<double, kMost> demand_N;  ///< normal force that each would exert alone
  std::array<double, kMost> share_N;   ///< in: of the last tick; out: of this one

  void add(const Vec3& normal, double demand, double share) noexcept {
    x[count] = normal.x();
    y[count] = normal.y();
    z[count] = normal.z();
    demand_N[count] = demand;
    share_N[count++] = share;
  }
};

/// Finds shares so that each contact adds what the others do not already exert along its normal:
/// share = max(0, demand - sum over the others of max(0, cosine between the normals) x their share).
/// Surfaces on top of each other are then as stiff as one, and surfaces across each other add up.
void shareNormalForce(PressingContacts& contacts) noexcept;

}  // namespace hapticd::realtime

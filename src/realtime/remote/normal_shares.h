// How contacts that overlap share the normal force.
#pragma once

#include <array>
#include <cstddef>

#include "realtime/remote/remote_input.h"
#include "realtime/render/pressed_faces.h"

namespace hapticd::realtime {

/// Contacts that press in one tick. Plain arrays: the solver walks along them.
struct PressingContacts {
  static constexpr std::size_t kMost = 2 * kMaxRemoteContacts + PressedFaces::kMost;

  std::size_t count = 0;
  std::size_t scene =
      kMost;  ///< from here on faces of the scene, which share among themselves by the full cosine
  std::array<double, kMost> x, y, z;             ///< normals, unit
  std::array<double, kMost> compliance_m_per_N;  ///< positive
  std::array<double, kMost> depth_m;  ///< at which it alone would exert the normal force it demands
  std::array<double, kMost> share_N;  ///< in: of the last tick; out: of this one

  Vec3 normal(std::size_t i) const noexcept { return {x[i], y[i], z[i]}; }
  void add(const Vec3& normal, double stiffness_N_per_m, double demand_N, double share) noexcept {
    x[count] = normal.x();
    y[count] = normal.y();
    z[count] = normal.z();
    compliance_m_per_N[count] = 1 / stiffness_N_per_m;
    depth_m[count] = demand_N * compliance_m_per_N[count];
    share_N[count++] = share;
  }
  /// After all others. Without the others, their shares are what they exert.
  void add(const PressedFaces& faces, double exerted) noexcept {
    scene = count;
    const double stiffness = exerted * faces.stiffness_N_per_m;
    const Vec3 way_m = faces.way_m();
    for (std::size_t i = 0; i < faces.count; ++i) {
      add(faces.normal[i], faces.stiffness_N_per_m, stiffness * faces.normal[i].dot(way_m),
          stiffness * faces.depth_m[i]);
    }
  }
};

/// Finds shares so that each contact adds what the others do not already exert along its normal:
/// share = max(0, demand - sum over the others of w x max(0, cosine between the normals) x their share),
/// where w is 1, or its own stiffness by that of the other, if the other is stiffer.
/// Surfaces on top of each other are then as stiff as the stiffest, and surfaces across each other add up.
/// The weights make the system symmetric, so that the forces have a potential, whatever the stiffness of
/// each.
void shareNormalForce(PressingContacts& contacts) noexcept;

}  // namespace hapticd::realtime

// The springs of a contact set, where a ball presses faces aside whose popthrough force is exceeded.
//
// Such a face pushes with that force over the length that the ball needs to get behind it, and as a spring
// from there on. What it gives way is missing where another face pushes against it, so that all faces
// together are one spring: from the HIP to the place q that minimises
//
//   1/2 K |q - HIP|^2 + sum P_i e_i
//
// with e_i the length by which q is behind a face that yields with P_i; behind others it may not be. The
// force is the gradient of this minimum, and gives no more than it took. Faces at an obtuse angle push no
// harder than each alone would: as the proxy meets one of them its force begins at zero.
#pragma once

#include <array>

#include "realtime/render/proxy.h"

namespace hapticd::realtime {

struct Springs {
  std::array<double, kMaxActive> forces_N{};  ///< of the faces, along their normals
  bool yields = false;                        ///< one of them; else nothing below
  Vec3 sum_N = Vec3::Zero();
  double stored_J = 0;  ///< with what friction bears
};

/// Of the contact set of a ball with this radius; 0: a point, for which nothing yields. noexcept, no
/// allocation.
Springs springsOf(const ContactSet& contactSet, double toolRadius_m) noexcept;

}  // namespace hapticd::realtime

// Rotations that Eigen computes by way of a singular value decomposition, whose code takes ten seconds to
// compile.
#pragma once

#include "geometry/types.h"

namespace hapticd::geometry {

/// The smallest rotation that takes the direction of `from` to that of `to`, neither of them zero. For
/// opposite directions, which have many, one of them: half a turn.
Quat rotationBetween(const Vec3& from, const Vec3& to);

}  // namespace hapticd::geometry

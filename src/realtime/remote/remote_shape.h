// A remote contact's surface at one time, as seen from the HIP.
#pragma once

#include "realtime/remote/remote_input.h"

namespace hapticd::realtime {

/// Where the surface is from the HIP.
struct SurfaceAt {
  double depth_m = 0;                    ///< of the HIP below the surface; negative outside
  Vec3 normal = Vec3::UnitY();           ///< unit, out of the material, at the point nearest to the HIP
  Vec3 velocity_m_per_s = Vec3::Zero();  ///< of the material at the HIP
};

/// `v` turned by a rotation vector, of at most some turns.
Vec3 turnedBy(const Vec3& rotation, const Vec3& v) noexcept;

/// The same surface in a frame that a similarity moved.
void moveBy(const geometry::Affine& motion, RemoteContact& contact) noexcept;

/// The surface `age_s` after it was stated, carried by its velocities: a round one turns about its centre,
/// which goes straight on; a flat one keeps its twist, so that it does not matter which of its points was
/// stated.
SurfaceAt surfaceAt(const RemoteContact& contact, double age_s, const Vec3& hip_m) noexcept;

}  // namespace hapticd::realtime

// A remote contact's surface at one time, as seen from the HIP.
#pragma once

#include "realtime/remote/remote_input.h"

namespace hapticd::realtime {

/// Where the surface is from the HIP.
struct SurfaceAt {
  double depth_m = 0;           ///< of the HIP below the surface; negative outside
  Vec3 normal = Vec3::UnitY();  ///< unit, out of the material, at the point nearest to the HIP
  Vec3 point_m = Vec3::Zero();  ///< the stated point, carried along
};

/// `v` turned by a rotation vector, of at most some turns.
Vec3 turnedBy(const Vec3& rotation, const Vec3& v) noexcept;

/// The surface `age_s` after it was stated, carried by its velocities.
SurfaceAt surfaceAt(const RemoteContact& contact, double age_s, const Vec3& hip_m) noexcept;

}  // namespace hapticd::realtime

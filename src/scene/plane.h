// Planes to touch that belong to no object.
#pragma once

#include <cstdint>
#include <memory>

#include "base/time.h"
#include "geometry/types.h"
#include "scene/force_owner.h"
#include "scene/surface.h"

namespace hapticd::scene {

inline constexpr std::int32_t kMaxPlanes = 8;

/// Texture and buzz raise a plane by at most this each, in metres of the device: a command that changes the
/// texture is no farther motion than one that moves the plane may be.
inline constexpr double kHighestDetail_m = 0.010;

/// A half space: solid where normal · x + offset < 0. World frame and units; only the front exerts force.
struct Plane {
  std::int32_t index = 0;
  geometry::Vec3 normal = geometry::Vec3::UnitY();  ///< unit
  double offset = 0;                                ///< world units
  Surface surface;
  base::Nanos recovery = 0;  ///< time over which a new placement fades in below the HIP
  double adhesionNormal_N = 0;
  double adhesionLateral_N = 0;
  double textureAmplitude = 0;   ///< world units; height A cos(2 π r / wavelength) around the first contact
  double textureWavelength = 0;  ///< world units; 0: no texture
  double buzzAmplitude = 0;      ///< world units; the height vibrates by it
  double buzzAngularFrequency_rad_per_s = 0;
  std::uint32_t placement = 0;  ///< counts placements: a new number is a plane that was not there before
  bool releasing = false;       ///< its owner is gone: ramp out in 250 ms
  std::shared_ptr<const ForceOwner> owner;  ///< null: of no client
};

}  // namespace hapticd::scene

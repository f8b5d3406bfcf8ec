// Force fields, also what point, line and plane constraints become, and the buzz.
#pragma once

#include <cstdint>
#include <memory>

#include "base/time.h"
#include "geometry/types.h"
#include "scene/force_owner.h"

namespace hapticd::scene {

/// Of the fields that ramp out after another one took their place, of sendForceField and of constraints
/// together.
inline constexpr std::size_t kMostReplacedFields = 8;

/// F = force + jacobian (x - origin), which fades to zero over the rim inside the radius, so that its edge is
/// no step. World frame and units, newtons.
struct ForceField {
  static constexpr double kLargest_N = 10;  ///< the limit of VRPN's own server

  geometry::Vec3 origin = geometry::Vec3::Zero();
  geometry::Vec3 force_N = geometry::Vec3::Zero();
  geometry::Mat3 jacobian_N_per_unit = geometry::Mat3::Zero();  ///< newtons per world unit
  double radius = 0;                                            ///< world units; may be infinite
  double rim = 0.1;                                             ///< share of the radius
  std::uint32_t number = 0;                                     ///< of this field only
  bool releasing = false;                                       ///< its owner is gone: ramp out in 250 ms
  std::shared_ptr<const ForceOwner> owner;                      ///< null: of no client
};

/// F = force sin(ω t) for a while; the servo starts its clock when it first sees a new `start` number.
struct Buzz {
  geometry::Vec3 force_N = geometry::Vec3::Zero();  ///< world frame
  double angularFrequency_rad_per_s = 0;
  base::Nanos duration = 0;
  std::uint32_t start = 0;
  bool releasing = false;                   ///< its owner is gone: ramp out in 250 ms
  std::shared_ptr<const ForceOwner> owner;  ///< null: of no client
};

}  // namespace hapticd::scene

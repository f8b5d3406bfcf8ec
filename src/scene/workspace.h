// The map between the client's world and the travel of the device.
#pragma once

#include "geometry/types.h"

namespace hapticd::scene {

using geometry::Affine;

/// A similarity (rotation, uniform scale, translation) between world units and device metres.
struct Workspace {
  Affine T_world_device =
      Affine(Eigen::UniformScaling<double>(1000.0));  ///< one world unit is 1 mm until set
  Affine T_device_world = Affine(Eigen::UniformScaling<double>(0.001));
  double worldUnitsPerMetre = 1000.0;
};

}  // namespace hapticd::scene

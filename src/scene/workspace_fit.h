// Fitting what a client looks at to what the device can reach.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "scene/config.h"
#include "scene/workspace.h"

namespace hapticd::scene {

/// A map from device metres to world units, or why there is none.
struct FittedWorkspace {
  std::optional<Affine> T_world_device;
  std::string refusal;  ///< why there is none
  std::string values;   ///< of the client, that are the reason
  std::string warning;  ///< what was done differently
};

/// The clip cube of a projection, seen through `model` (both column-major), onto the device's box.
FittedWorkspace fitProjection(const std::array<double, 16>& model, const std::array<double, 16>& projection,
                              const geometry::Box& device_m, WorkspaceFit fit);

/// A box in the world (min xyz, max xyz), seen through `model`, onto the device's box.
FittedWorkspace fitBox(const std::array<double, 16>& model, const std::array<double, 6>& box,
                       const geometry::Box& device_m, WorkspaceFit fit);

/// Fills in inverse and scale of a similarity.
Workspace workspaceFrom(const Affine& T_world_device);

}  // namespace hapticd::scene

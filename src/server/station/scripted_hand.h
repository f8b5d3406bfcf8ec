// A scripted hand: where a person would go to feel what is in the scene.
#pragma once

#include <vector>

#include "base/time.h"
#include "device/simulated/waypoint_path.h"
#include "scene/snapshot.h"

namespace hapticd::server {

/// A round of strokes over the touchable objects of a scene: approach a point from outside, press a few
/// millimetres in, slide along, lift, turn to the next. Deterministic. An empty scene gives a slow circle in
/// the workspace. The path starts and ends at rest outside all objects, so it can be repeated.
std::vector<device::Waypoint> planStrokes(const scene::SceneSnapshot& scene, const geometry::Box& workspace_m,
                                      base::Nanos now);

}  // namespace hapticd::server

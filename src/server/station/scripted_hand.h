// Plans the path of the scripted hand over the objects of a scene.
#pragma once

#include <vector>

#include "base/time.h"
#include "device/simulated/waypoint_path.h"
#include "scene/snapshot.h"

namespace hapticd::server {

/// Plans strokes over the touchable objects of a scene: approach a point from outside, press a few
/// millimetres in, slide, lift, move to the next. Deterministic; an empty scene gives a slow circle in the
/// workspace. The path starts and ends at rest outside all objects, so it can be repeated. Metres, device
/// frame; `now`: time of the objects' motion.
std::vector<device::Waypoint> planStrokes(const scene::SceneSnapshot& scene, const geometry::Box& workspace_m,
                                          base::Nanos now);

}  // namespace hapticd::server

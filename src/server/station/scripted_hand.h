// Plans the path of the scripted hand over the objects of a scene.
#pragma once

#include <atomic>
#include <vector>

#include "base/time.h"
#include "device/simulated/waypoint_path.h"
#include "scene/snapshot.h"

namespace hapticd::server {

/// The largest force of the scripted hand's muscles, N. With its mass and what friction adds, it presses with
/// at most 2 N, as a curious person does.
inline constexpr double kScriptedStrength_N = 1.6;

/// Plans strokes over the touchable objects of a scene: approach a point from outside, press a few
/// millimetres in, follow the surface, lift where there is a free way out, go to the next. Each stroke is
/// felt by a simulated hand first, and shortened or left out where something would hold the hand back.
/// Deterministic; an empty scene gives a slow circle in the workspace. The path starts and ends at rest
/// outside all objects, so it can be repeated. Metres, device frame; `now`: time of the objects' motion.
/// `ended`: once it is set, from any thread, no further stroke is planned; null: never.
std::vector<device::Waypoint> planStrokes(const scene::SceneSnapshot& scene, const geometry::Box& workspace_m,
                                          base::Nanos now, const std::atomic<bool>* ended = nullptr);

}  // namespace hapticd::server

#include "record/changed_surfaces.h"

#include <algorithm>

#include "scene/surface_settings.h"

namespace hapticd::record {

void ChangedSurfaces::change(scene::Surface& surface) const {
  surface.stiffness_N_per_m = changes_.stiffness_N_per_m.value_or(surface.stiffness_N_per_m);
  surface.damping_Ns_per_m = changes_.damping_Ns_per_m.value_or(surface.damping_Ns_per_m);
  surface.dynamicFriction = changes_.dynamicFriction.value_or(surface.dynamicFriction);
  // A dynamic one alone raises the static one, which bounds it.
  surface.staticFriction = changes_.staticFriction.value_or(
      changes_.dynamicFriction ? std::max(surface.staticFriction, surface.dynamicFriction)
                               : surface.staticFriction);
  surface.dynamicFriction = std::min(surface.dynamicFriction, surface.staticFriction);
  std::string remark;
  scene::keepPassive(surface, bound_, remark);
}

std::shared_ptr<const scene::SceneSnapshot> ChangedSurfaces::of(
    std::shared_ptr<const scene::SceneSnapshot> snapshot) {
  if (!snapshot || !changes_.surfaces()) return snapshot;
  auto changed = std::make_shared<scene::SceneSnapshot>(*snapshot);
  std::unordered_map<State, State> known;
  for (State& state : changed->objects) {
    const auto before = known_.find(state);
    State now = before != known_.end() ? before->second : nullptr;
    if (!now) {
      auto fresh = std::make_shared<scene::ObjectState>(*state);
      change(fresh->surface);
      now = std::move(fresh);
    }
    known.emplace(state, now);
    state = now;
  }
  for (scene::Plane& plane : changed->planes) change(plane.surface);
  known_ = std::move(known);
  return changed;
}

}  // namespace hapticd::record

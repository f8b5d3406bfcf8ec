// Snapshots with other surfaces.
#pragma once

#include <memory>
#include <unordered_map>

#include "record/rerender.h"
#include "scene/passivity.h"
#include "scene/snapshot.h"

namespace hapticd::record {

/// For one device. Objects that two snapshots share are shared by the changed ones, too.
class ChangedSurfaces {
 public:
  ChangedSurfaces(const RerenderChanges& changes, const scene::SceneConfig& config)
      : changes_(changes), bound_(config) {}

  std::shared_ptr<const scene::SceneSnapshot> of(std::shared_ptr<const scene::SceneSnapshot> snapshot);

 private:
  using State = std::shared_ptr<const scene::ObjectState>;

  void change(scene::Surface& surface) const;

  const RerenderChanges changes_;
  const scene::PassivityBound bound_;
  std::unordered_map<State, State> known_;  // of the newest snapshot
};

}  // namespace hapticd::record

// A trial as snapshots for the renderer under test.
#pragma once

#include <memory>
#include <vector>

#include "realtime/render/scene_fixture.h"
#include "truth/trial.h"

namespace hapticd::truth {

class Stage {
 public:
  explicit Stage(const Trial& trial);

  /// The snapshot of that tick; ticks in ascending order. It and the previous one stay alive.
  const scene::SceneSnapshot& at(int tick);

 private:
  std::shared_ptr<const scene::SceneSnapshot> snapshotOf(int phase) const;

  const Trial& trial_;
  std::vector<std::shared_ptr<scene::MeshGeometry>> geometry_;
  int lastPhase_ = 0;  // from here on all objects keep their pose
  int phase_ = -1;
  std::shared_ptr<const scene::SceneSnapshot> before_;
  std::shared_ptr<const scene::SceneSnapshot> now_;
};

}  // namespace hapticd::truth

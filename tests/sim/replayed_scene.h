// Where the objects of a recording are at each time: a plain model of the commands in it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "record/recording.h"
#include "scene/description.h"
#include "sim/scheduler.h"

namespace hapticd::sim {

/// Knows poses, which objects exist and have a mesh, batches, and clients that leave; of a scene whose
/// commands were all accepted.
class ReplayedScene {
 public:
  /// Throws record::RecordingError.
  explicit ReplayedScene(const std::filesystem::path& file);

  /// A time in the recording, since its first event: mostly early, often soon after the begin of a batch.
  Nanos drawTime(Dice& dice) const;
  /// What differs from the scene of every moment in [from, to]; empty when one of them is the same.
  std::string difference(const scene::SceneDescription& shown, Nanos from, Nanos to) const;

 private:
  struct Change {
    enum class Kind { pose, mesh, objectNumber, begin, commit, gone };
    Nanos time;
    scene::ClientId client;
    Kind kind;
    std::int32_t object;  // or the number of objects
    geometry::Vec3 place;
  };
  struct State {
    std::int32_t objectNumber = 1;   // object 0 is always there
    std::set<std::int32_t> objects;  // of further ones
    std::set<std::int32_t> meshes;   // objects that have vertices
    std::map<std::int32_t, geometry::Vec3> poses;
    std::map<scene::ClientId, std::vector<Change>> batches;  // open ones
  };
  void add(const record::SceneEvent& event);
  static void apply(const Change& change, State& state);
  static std::string difference(const scene::SceneDescription& shown, const State& state);

  std::vector<Change> changes_;  // by time
  Nanos begin_ = 0;
  Nanos end_ = 0;
};

}  // namespace hapticd::sim

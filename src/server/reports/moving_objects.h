// Where the objects that move are, for pictures: evaluated for the time of a tick with
// the newest motions, which a late tick may not have taken over yet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <vector>

#include "scene/snapshot.h"

namespace hapticd::server {

/// The objects of one device's scene that move, or came to rest in the last second. Objects that cannot be
/// felt do not move in a snapshot and are not among them.
class MovingObjects {
 public:
  /// Scene thread: looks for motion in a snapshot that the servo was given.
  void published(const scene::SceneSnapshot& snapshot, base::Nanos now);

  /// Net thread: appends up to `most` objects, from `next` on, at the time of a tick: id, then the columns
  /// and the translation of T_world_mesh. `next` goes round when there are more.
  void append(base::Nanos time, std::size_t most, std::size_t& next, std::vector<double>& numbers);

 private:
  struct Placed {
    std::int32_t id = 0;
    scene::Affine to = scene::Affine::Identity();
  };
  struct Moving {
    std::int32_t id = 0;
    scene::Motion motion;
    base::Nanos restedAt = 0;  // 0: it moves
  };
  void refresh();

  std::vector<Placed> before_;  // scene thread: the destinations of the previous snapshot

  std::mutex mutex_;
  std::vector<Moving> published_;  // since the last refresh()

  std::vector<Moving> moving_;  // net thread, by id
};

}  // namespace hapticd::server

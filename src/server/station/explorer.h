// Plans the path of the scripted hand in a thread of its own: over a large scan that takes a tenth of a
// second.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>

#include "base/thread.h"
#include "device/simulated/steered_hand.h"
#include "geometry/types.h"
#include "scene/snapshot.h"

namespace hapticd::server {

/// Lets a simulated hand explore what is in a scene.
class Explorer {
 public:
  /// `hand` must outlive the explorer; `device`: its name, for the log.
  Explorer(device::SteeredHand& hand, const geometry::Box& workspace_m, std::string device)
      : hand_(hand), workspace_m_(workspace_m), device_(std::move(device)) {}
  ~Explorer() {
    ended_ = true;
    thread_.stop();
  }

  /// Explores this scene from now on; scenes that come while it plans are skipped but for the last. Scene
  /// thread.
  void explore(std::shared_ptr<const scene::SceneSnapshot> scene);

 private:
  void plan();

  device::SteeredHand& hand_;
  const geometry::Box workspace_m_;
  const std::string device_;
  std::atomic<bool> ended_{false};
  std::mutex mutex_;
  std::shared_ptr<const scene::SceneSnapshot> next_;  // guarded by mutex_; null: planned
  base::Thread thread_;                               // last: its step uses the others
};

}  // namespace hapticd::server

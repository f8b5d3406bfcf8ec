// Descriptions of the scenes for HTTP responses, requested on demand: an unwatched server does no work for
// them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "net/loop.h"
#include "scene/description.h"
#include "server/scene/scene_host.h"

namespace hapticd::server {

/// One scene at one moment. Immutable; any thread reads it.
struct ObservedScene {
  std::shared_ptr<const scene::SceneDescription> description;
  std::vector<std::uint64_t>
      geometry;  ///< shape number of each object; it changes with the shape; 0: no shape
};

/// Net thread. Keeps at most one request to each scene under way, however many clients ask.
class SceneWatch {
 public:
  using Dispose = std::function<void(std::shared_ptr<const void>)>;

  /// `dispose` takes old descriptions, which may be large, and frees them on another thread.
  SceneWatch(net::Loop& loop, std::vector<SceneHost*> scenes, Dispose dispose);

  /// Calls `then` when all scenes have replied. A busy scene delays it by 250 ms at most, by 3 s before its
  /// first reply.
  void refresh(std::function<void()> then);
  /// Latest description of each scene; null until the first reply.
  const std::vector<std::shared_ptr<const ObservedScene>>& latest() const noexcept { return latest_; }
  /// Frees the descriptions; the next refresh() requests them again.
  void forget();

 private:
  void beginRound();
  void onReply(std::size_t scene, std::shared_ptr<const scene::SceneDescription> description);
  void endRound();
  std::vector<std::uint64_t> shapeNumbers(const scene::SceneDescription& now, const ObservedScene* before);

  net::Loop& loop_;
  const std::vector<SceneHost*> scenes_;
  const Dispose dispose_;
  std::vector<std::shared_ptr<const ObservedScene>> latest_;
  std::vector<char> pending_;                   // 1: the scene has not replied yet
  std::vector<std::function<void()>> waiting_;  // for the next round
  std::vector<std::function<void()>> inRound_;
  net::Subscription timeout_;
  std::uint64_t lastNumber_ = 0;
};

}  // namespace hapticd::server

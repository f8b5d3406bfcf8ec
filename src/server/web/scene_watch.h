// The scenes as the web sees them: asked for when somebody looks, so that an unwatched server does no work.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "net/loop.h"
#include "scene/description.h"
#include "server/scene/scene_host.h"

namespace hapticd::server {

/// One scene at one moment, and what was counted of it. Immutable; any thread reads.
struct SceneView {
  std::shared_ptr<const scene::SceneDescription> description;
  std::vector<std::uint64_t> geometry;  ///< of each object: another number is another shape; 0 is none
};

/// Net thread. Asks each scene at most one question at a time, however many want to know.
class SceneWatch {
 public:
  using Dispose = std::function<void(std::shared_ptr<const void>)>;

  /// `dispose` frees elsewhere what may be large.
  SceneWatch(net::Loop& loop, std::vector<SceneHost*> scenes, Dispose dispose);

  /// Calls `then` when all scenes have told how they are, or after a while if one is busy.
  void refresh(std::function<void()> then);
  /// What the scenes told last; null before their first word.
  const std::vector<std::shared_ptr<const SceneView>>& views() const noexcept { return views_; }
  /// Nobody has looked for a while.
  void forget();

 private:
  void beginRound();
  void onAnswer(std::size_t scene, std::shared_ptr<const scene::SceneDescription> description);
  void endRound();
  std::vector<std::uint64_t> numbersFor(const scene::SceneDescription& now, const SceneView* before);

  net::Loop& loop_;
  const std::vector<SceneHost*> scenes_;
  const Dispose dispose_;
  std::vector<std::shared_ptr<const SceneView>> views_;
  std::vector<char> asked_;                     // whose answer has not come yet
  std::vector<std::function<void()>> waiting_;  // for the next round
  std::vector<std::function<void()>> inRound_;
  net::Subscription patience_;
  std::uint64_t lastNumber_ = 0;
};

}  // namespace hapticd::server

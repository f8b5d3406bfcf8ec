#include "server/web/scene_watch.h"

#include <algorithm>
#include <chrono>

namespace hapticd::server {

using namespace std::chrono_literals;

SceneWatch::SceneWatch(net::Loop& loop, std::vector<SceneHost*> scenes, Dispose dispose)
    : loop_(loop),
      scenes_(std::move(scenes)),
      dispose_(std::move(dispose)),
      latest_(scenes_.size()),
      pending_(scenes_.size(), 0) {}

void SceneWatch::refresh(std::function<void()> then) {
  waiting_.push_back(std::move(then));
  if (inRound_.empty()) beginRound();
}

void SceneWatch::beginRound() {
  inRound_ = std::exchange(waiting_, {});
  for (std::size_t i = 0; i < scenes_.size(); ++i) {
    if (std::exchange(pending_[i], 1) != 0) continue;
    scenes_[i]->describe([this, i](std::shared_ptr<const scene::SceneDescription> description) {
      loop_.post([this, i, description = std::move(description)] { onReply(i, description); });
    });
  }
  // A scene that builds a large mesh replies late: an old description is better than a late response.
  const bool allKnown =
      std::all_of(latest_.begin(), latest_.end(), [](const auto& v) { return v != nullptr; });
  timeout_ = loop_.after(allKnown ? 250ms : 3000ms, [this] { endRound(); });
}

void SceneWatch::onReply(std::size_t scene, std::shared_ptr<const scene::SceneDescription> description) {
  pending_[scene] = 0;
  if (description) {
    auto observed = std::make_shared<ObservedScene>();
    observed->geometry = shapeNumbers(*description, latest_[scene].get());
    observed->description = std::move(description);
    dispose_(std::exchange(latest_[scene], std::move(observed)));
  }
  if (std::none_of(pending_.begin(), pending_.end(), [](char pending) { return pending != 0; })) endRound();
}

// Both lists are sorted by id. The previous description keeps its shapes alive, so pointer equality means the
// same shape.
std::vector<std::uint64_t> SceneWatch::shapeNumbers(const scene::SceneDescription& now,
                                                    const ObservedScene* before) {
  static const std::vector<scene::ObjectDescription> kNone;
  const auto& known = before != nullptr ? before->description->objects : kNone;
  std::vector<std::uint64_t> numbers;
  numbers.reserve(now.objects.size());
  std::size_t old = 0;
  for (const scene::ObjectDescription& object : now.objects) {
    while (old < known.size() && known[old].id < object.id) ++old;
    const bool same = old < known.size() && known[old].id == object.id &&
                      known[old].triangles == object.triangles && known[old].vertices == object.vertices;
    numbers.push_back(!object.triangles ? 0 : same ? before->geometry[old] : ++lastNumber_);
  }
  return numbers;
}

void SceneWatch::endRound() {
  timeout_.cancel();
  for (const auto& then : std::exchange(inRound_, {})) then();
  if (inRound_.empty() && !waiting_.empty()) beginRound();
}

void SceneWatch::forget() {
  for (auto& observed : latest_) {
    if (observed) dispose_(std::exchange(observed, nullptr));
  }
}

}  // namespace hapticd::server

#include "server/web/scene_watch.h"

#include <algorithm>
#include <chrono>

namespace hapticd::server {

using namespace std::chrono_literals;

SceneWatch::SceneWatch(net::Loop& loop, std::vector<SceneHost*> scenes, Dispose dispose)
    : loop_(loop),
      scenes_(std::move(scenes)),
      dispose_(std::move(dispose)),
      views_(scenes_.size()),
      asked_(scenes_.size(), 0) {}

void SceneWatch::refresh(std::function<void()> then) {
  waiting_.push_back(std::move(then));
  if (inRound_.empty()) beginRound();
}

void SceneWatch::beginRound() {
  inRound_ = std::exchange(waiting_, {});
  for (std::size_t i = 0; i < scenes_.size(); ++i) {
    if (std::exchange(asked_[i], 1) != 0) continue;
    scenes_[i]->describe([this, i](std::shared_ptr<const scene::SceneDescription> description) {
      loop_.post([this, i, description = std::move(description)] { onAnswer(i, description); });
    });
  }
  // A large mesh is being built: better what was the case than nothing.
  const bool allKnown = std::all_of(views_.begin(), views_.end(), [](const auto& v) { return v != nullptr; });
  patience_ = loop_.after(allKnown ? 250ms : 3000ms, [this] { endRound(); });
}

void SceneWatch::onAnswer(std::size_t scene, std::shared_ptr<const scene::SceneDescription> description) {
  asked_[scene] = 0;
  auto view = std::make_shared<SceneView>();
  view->geometry = numbersFor(*description, views_[scene].get());
  view->description = std::move(description);
  dispose_(std::exchange(views_[scene], std::move(view)));
  if (std::none_of(asked_.begin(), asked_.end(), [](char asked) { return asked != 0; })) endRound();
}

// Both lists are sorted by id. The shapes of before still exist, so an equal address is the same shape.
std::vector<std::uint64_t> SceneWatch::numbersFor(const scene::SceneDescription& now,
                                                  const SceneView* before) {
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
  patience_.cancel();
  for (const auto& then : std::exchange(inRound_, {})) then();
  if (inRound_.empty() && !waiting_.empty()) beginRound();
}

void SceneWatch::forget() {
  for (auto& view : views_) {
    if (view) dispose_(std::exchange(view, nullptr));
  }
}

}  // namespace hapticd::server

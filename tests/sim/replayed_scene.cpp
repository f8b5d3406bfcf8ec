#include "sim/replayed_scene.h"

#include <algorithm>
#include <limits>

#include "record/recording_reader.h"

namespace hapticd::sim {

using geometry::Vec3;

ReplayedScene::ReplayedScene(const std::filesystem::path& file) : begin_(std::numeric_limits<Nanos>::max()) {
  record::RecordingReader reader(file);
  for (record::RecordingEvent event; reader.next(event);) {
    const auto* const tick = std::get_if<record::TickEvent>(&event);
    const auto* const scene = std::get_if<record::SceneEvent>(&event);
    if (tick == nullptr && scene == nullptr) continue;
    const Nanos time = tick != nullptr ? tick->tick.report.time : scene->time;
    begin_ = std::min(begin_, time);
    end_ = std::max(end_, time);
    if (scene != nullptr) add(*scene);
  }
  std::stable_sort(changes_.begin(), changes_.end(),
                   [](const Change& a, const Change& b) { return a.time < b.time; });
}

void ReplayedScene::add(const record::SceneEvent& event) {
  const auto change = [&](Change::Kind kind, std::int32_t object = 0, const Vec3& place = Vec3::Zero()) {
    changes_.push_back({event.time, event.client, kind, object, place});
  };
  if (!event.command) return change(Change::Kind::gone);
  const scene::SceneCommand& command = *event.command;
  if (const auto* pose = std::get_if<scene::SetTransform>(&command)) {
    change(Change::Kind::pose, pose->object, {pose->matrix[12], pose->matrix[13], pose->matrix[14]});
  } else if (const auto* vertices = std::get_if<scene::SetVertices>(&command)) {
    change(Change::Kind::mesh, vertices->object);
  } else if (const auto* number = std::get_if<scene::SetObjectNumber>(&command)) {
    change(Change::Kind::objectNumber, number->count);
  } else if (std::holds_alternative<scene::BeginBatch>(command)) {
    change(Change::Kind::begin);
  } else if (std::holds_alternative<scene::CommitBatch>(command)) {
    change(Change::Kind::commit);
  }
}

Nanos ReplayedScene::drawTime(Dice& dice) const {
  constexpr Nanos kSoon = 20 * kMs;
  if (dice.chance(0.5) || changes_.empty()) return dice.between(0, dice.between(0, end_ - begin_));
  auto change = changes_.begin() + static_cast<std::ptrdiff_t>(dice.below(changes_.size()));
  while (change != changes_.begin() && change->kind != Change::Kind::begin) --change;
  return change->time - begin_ + dice.between(1, kSoon);
}

void ReplayedScene::apply(const Change& change, State& state) {
  const auto batch = state.batches.find(change.client);
  switch (change.kind) {
    case Change::Kind::begin:
      state.batches.try_emplace(change.client);
      return;
    case Change::Kind::gone:
      state.batches.erase(change.client);
      return;
    case Change::Kind::commit: {
      auto changes = state.batches.extract(change.client);
      if (!changes.empty()) {
        for (const Change& inside : changes.mapped()) apply(inside, state);
      }
      return;
    }
    default:
      break;
  }
  if (batch != state.batches.end()) return batch->second.push_back(change);
  if (change.kind == Change::Kind::objectNumber) {
    state.objectNumber = std::max(state.objectNumber, change.object);
    return;
  }
  state.objects.insert(change.object);
  if (change.kind == Change::Kind::mesh) state.meshes.insert(change.object);
  if (change.kind == Change::Kind::pose) state.poses[change.object] = change.place;
}

std::string ReplayedScene::difference(const scene::SceneDescription& shown, const State& state) {
  const auto named = [](std::int32_t id) { return "object " + std::to_string(id); };
  for (const auto& object : shown.objects) {
    if (object.id >= state.objectNumber && state.objects.count(object.id) == 0)
      return named(object.id) + " was not there";
    if (object.triangles && (!object.vertices || object.vertices->empty()))
      return named(object.id) + " has triangles and no vertices";
    if (object.triangles && state.meshes.count(object.id) == 0) return named(object.id) + " had no mesh";
  }
  for (const auto& [id, place] : state.poses) {
    const auto object = std::find_if(shown.objects.begin(), shown.objects.end(),
                                     [id = id](const auto& candidate) { return candidate.id == id; });
    if (object == shown.objects.end()) return named(id) + " is missing";
    if ((object->T_world_object.translation() - place).norm() > 1e-9) return named(id) + " was elsewhere";
  }
  return {};
}

std::string ReplayedScene::difference(const scene::SceneDescription& shown, Nanos from, Nanos to) const {
  State state;
  auto change = changes_.begin();
  for (; change != changes_.end() && change->time < begin_ + from; ++change) apply(*change, state);
  const std::string text = difference(shown, state);
  if (text.empty()) return {};
  for (; change != changes_.end() && change->time <= begin_ + to; ++change) {
    apply(*change, state);
    if (difference(shown, state).empty()) return {};
  }
  return text;
}

}  // namespace hapticd::sim

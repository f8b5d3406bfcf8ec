// The tree of objects. object_commands.cpp has the commands, object_publish.cpp the publication.
#include "scene/object_table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/world.h"

namespace hapticd::scene {
Nanos PoseStream::next(Nanos now) {
  const Nanos gap = now - last_;
  if (any_ && gap < kSameMoment) return blend_;
  last_ = now;
  if (!std::exchange(any_, true) || gap > kLongestGap) {
    interval_ = 0;
    return blend_ = kUnmeasured;
  }
  // A late pose lengthens the blend at once, early ones shorten it little by little: networks bunch.
  interval_ = interval_ == 0 || gap > interval_ ? gap : interval_ + (gap - interval_) / 4;
  return blend_ = std::clamp<Nanos>(interval_, kSameMoment, kLongestBlend);
}

void Trail::add(const Box& swept, Nanos now) {
  if (now - begin_ > kLength) {
    older_ = now - begin_ > 2 * kLength ? Box{} : recent_;
    recent_ = Box{};
    begin_ = now;
  }
  recent_.extend(swept);
}

Box Trail::around(Nanos now) const {
  if (now - begin_ > 2 * kLength) return {};
  Box all = recent_;
  all.extend(older_);
  return all;
}

ObjectTable::ObjectTable(const SceneConfig& config)
    : config_(config),
      bound_(config),
      stopwatch_(config.stopwatch ? config.stopwatch : base::now),
      clock_(config.clock ? config.clock : stopwatch_),
      checks_(stopwatch_) {
  create(0, Object::kScene);
}

void ObjectTable::reset() {
  objects_.clear();
  moves_.clear();
  sceneTravel_.reset();
  changed_.clear();
  edited_.clear();
  checks_.clear();
  T_world_scene_ = Affine::Identity();
  asked_.clear();
  scenePoses_ = {};
  vertices_ = 0;
  gaps_ = 0;
  triangles_ = 0;
  listChanged_ = true;
  create(0, Object::kScene);
}

Object* ObjectTable::find(std::int32_t id) const {
  if (id < 0 || static_cast<std::size_t>(id) >= objects_.size()) return nullptr;
  return objects_[static_cast<std::size_t>(id)].get();
}

Object* ObjectTable::find(std::int32_t id, std::string_view name, const Call& call) const {
  Object* object = find(id);
  if (object == nullptr) {
    call.refuse(name, "refused: there is no such object; call setObjectNumber or addObject first", " object ",
                id);
  }
  return object;
}

void ObjectTable::create(std::int32_t id, std::int32_t parent) {
  if (objects_.size() <= static_cast<std::size_t>(id)) objects_.resize(static_cast<std::size_t>(id) + 1);
  auto& slot = objects_[static_cast<std::size_t>(id)];
  slot = std::make_unique<Object>();
  slot->id = id;
  attach(*slot, parent);
  moveAll(*slot, 0);
}

void ObjectTable::attach(Object& object, std::int32_t parent) {
  object.parent = parent;
  if (Object* p = find(parent)) p->children.push_back(object.id);
}

void ObjectTable::detach(Object& object) {
  if (Object* p = find(object.parent)) std::erase(p->children, object.id);
}

template <class F>
void ObjectTable::withDescendants(Object& object, const F& f) {
  f(object);
  for (const std::int32_t child : object.children) withDescendants(*find(child), f);
}

void ObjectTable::erase(std::int32_t id) {
  Object& object = *find(id);
  while (!object.children.empty()) erase(object.children.back());
  detach(object);
  if (object.position >= 0) listChanged_ = true;
  vertices_ -= object.mesh.vertexCount();
  closeGap(object, object.gap);
  triangles_ -= object.mesh.triangleCount();
  objects_[static_cast<std::size_t>(id)].reset();
  if (id == 0) create(0, Object::kScene);
}

std::int32_t ObjectTable::depth(std::int32_t id) const {
  std::int32_t levels = 0;
  for (const Object* o = find(id); o != nullptr; o = find(o->parent)) ++levels;
  return levels;
}

std::int32_t ObjectTable::height(const Object& object) const {
  std::int32_t below = 0;
  for (const std::int32_t child : object.children) below = std::max(below, height(*find(child)));
  return below + 1;
}

bool ObjectTable::checkParent(std::int32_t id, std::int32_t parent, std::string_view name,
                              const Call& call) const {
  if (parent == Object::kScene) return true;
  if (find(parent) == nullptr) {
    call.refuse(name, "refused: there is no such parent; use -1 for the scene", " object ", id, ", parent ",
                parent);
    return false;
  }
  const Object* object = find(id);
  for (const Object* o = find(parent); o != nullptr; o = find(o->parent)) {
    if (o->id != id) continue;
    call.refuse(name, "refused: the object would be its own ancestor", " object ", id, ", parent ", parent);
    return false;
  }
  if (depth(parent) + (object == nullptr ? 1 : height(*object)) > config_.limits.nesting) {
    call.refuse(name, "refused: nested too deeply", " object ", id, ", parent ", parent, ", at most ",
                config_.limits.nesting, " levels");
    return false;
  }
  return true;
}

// First all objects below the scene, then the tree: each of its states is a part of the final one. The
// children of an object come in their order, in which they move.
void ObjectTable::appendCommands(std::vector<ClientCommand>& out) const {
  const auto add = [&](SceneCommand command) { out.push_back({0, std::move(command)}); };
  add(SetObjectNumber{static_cast<std::int32_t>(objects_.size())});
  for (std::size_t id = 0; id < objects_.size(); ++id) {
    if (!objects_[id]) add(RemoveObject{static_cast<std::int32_t>(id)});
  }
  for (const auto& object : objects_) {
    if (!object) continue;
    for (const std::int32_t child : object->children) add(MoveToParent{child, object->id});
  }
  for (const auto& object : objects_) {
    if (!object) continue;
    if (object->parent == Object::kNoParent) {
      add(AddObjectExScene{object->id});
    } else if (object->inMetres) {
      add(AddObject{object->id, object->parent});
    }
    object->mesh.appendCommands(object->id, object->meshSetBy, object->inMetres, out);
    object->asked.appendTo(out);
  }
  asked_.appendTo(out);
}

void ObjectTable::appendEditsUnderWay(Nanos now, std::vector<ClientCommand>& out) const {
  for (const std::int32_t id : edited_) {
    const Object* object = find(id);
    if (object != nullptr) object->mesh.appendEditsUnderWay(id, object->meshSetBy, out);
  }
  if (rebuildNotBefore_ > now) out.push_back({0, PauseRebuilds{rebuildNotBefore_ - now}, now});
  if (lastTopology_ == 0) return;
  out.push_back({0, ContinueCheck{}, now});
  for (const MeshChecks::Pending& check : checks_.waiting()) {
    const Object* object = find(check.object);
    const bool isCurrent =
        object != nullptr && object->geometry && object->geometry->topology == check.topology;
    out.push_back({0, ContinueCheck{check.object, isCurrent, std::max<Nanos>(check.at - now, 0)}, now});
  }
}

void ObjectTable::queue(Object& object) {
  if (object.queued) return;
  object.queued = true;
  changed_.push_back(object.id);
}

// Only notes the move: a command must not cost more than its size, however many objects are below. A jump is
// not undone by a stream of a parent in the same moment.
void ObjectTable::moveAll(Object& root, Nanos travel) {
  root.pendingTravel = root.movePending ? std::min(root.pendingTravel, travel) : travel;
  if (!std::exchange(root.movePending, true)) moves_.push_back(root.id);
}

void ObjectTable::moveScene(Nanos travel) {
  sceneTravel_ = std::min(sceneTravel_.value_or(travel), travel);
}

// An object that got another parent since its move was noted has a jump of its own, which wins.
void ObjectTable::spreadMoves() {
  if (sceneTravel_) {
    for (const auto& object : objects_) {
      if (object && object->parent == Object::kScene) moveAll(*object, *sceneTravel_);
    }
    sceneTravel_.reset();
  }
  for (const std::int32_t id : moves_) {
    Object* root = find(id);
    if (root == nullptr || !std::exchange(root->movePending, false)) continue;
    withDescendants(*root, [&](Object& object) {
      object.travel = object.moved ? std::min(object.travel, root->pendingTravel) : root->pendingTravel;
      object.moved = true;
      queue(object);
    });
  }
  moves_.clear();
}

void ObjectTable::becomeStock(Object& object) {
  if (object.inMetres) return;
  object.inMetres = true;
  moveAll(object, 0);
}

void ObjectTable::place(Object& object, const Affine& T_parent_object, const Call& call) {
  const Nanos travel = object.poses.next(call.now);
  if (T_parent_object.matrix() == object.T_parent_object.matrix()) return;
  object.T_parent_object = T_parent_object;
  moveAll(object, travel);
}

}  // namespace hapticd::scene

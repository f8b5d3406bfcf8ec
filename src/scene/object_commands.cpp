// The commands on objects. Each checks all of its values before it changes anything.
#include <algorithm>
#include <string>
#include <utility>

#include "scene/object_table.h"

namespace hapticd::scene {
namespace {

constexpr std::string_view kSetTriangle = "setTriangle";
constexpr std::string_view kBadMatrix =
    "refused: the matrix is not finite or too large, is singular, or its last row is not 0 0 0 1";

// Vertices or triangles that may be missing before a run. Clients may send a mesh from its end, or with
// numbers that leave room: all meshes together have a bounded number of such gaps, which sending the numbers
// closes.
constexpr std::size_t kGap = 65'536;
constexpr std::size_t kGapsInAll = 1'000'000;
constexpr Nanos kLongestPause = 60'000'000'000;  // that a recording may state

}  // namespace

// The rest is refused: what there is room for must not depend on which messages came together in one run.
std::size_t ObjectTable::roomFor(Object& object, std::int64_t first, std::size_t count, std::size_t present,
                                 std::uint32_t perObject, std::uint64_t inAll, std::uint64_t used,
                                 std::string_view name, std::string_view what, const Call& call) {
  if (first < 0) {
    call.refuse(name, "refused: numbers start at 0", " object ", object.id, ", ", what, " ", first);
    return 0;
  }
  const auto start = static_cast<std::size_t>(first);
  std::size_t end = start + count;
  if (count == 0) return 0;
  if (end > perObject) {
    end = perObject;
    call.refuse(name, "refused: beyond the limit of one object", " object ", object.id, ", ", what, " ",
                std::max(start, end), ", limit ", perObject);
    if (start >= end) return 0;
  }
  const std::size_t fits = present + (inAll > used ? inAll - used : 0);
  if (end > present && end > fits) {
    end = std::max(fits, present);
    call.refuse(name, "refused: the scene is full; clear or remove objects first", " object ", object.id,
                ", ", what, " ", std::max(start, end), ", limit ", inAll, " in all objects");
    if (start >= end) return 0;
  }
  // Numbers far beyond the present ones would make a few bytes cost megabytes.
  if (start > 2 * present + kGap) {
    const std::size_t gap = start - present;
    if (gaps_ + gap > kGapsInAll) {
      call.refuse(name,
                  "refused: too far beyond the numbers that were sent; send them in about ascending order",
                  " object ", object.id, ", ", what, " ", first, ", at most ",
                  std::max(2 * present + kGap, present + kGapsInAll - gaps_), " now");
      return 0;
    }
    object.gap += gap;
    gaps_ += gap;
  } else if (end <= present) {
    closeGap(object, end - start);
  }
  return end - start;
}

// Without numbered triangles each three vertices are one.
std::size_t ObjectTable::roomForTriples(const Object& object, const SetVertices& c, std::string_view name,
                                        const Call& call) const {
  const std::size_t count = c.positions.size();
  const std::int64_t most = config_.limits.verticesPerObject;
  if (object.mesh.indexed() || c.first < 0 || c.first >= most) return count;
  const std::uint64_t others = triangles_ - object.mesh.triangleCount();
  const std::uint64_t inAll = config_.limits.trianglesInAll;
  const std::uint64_t fit = 3 * (inAll > others ? inAll - others : 0) + 2;
  const auto start = static_cast<std::uint64_t>(c.first);
  if (start + count <= std::max<std::uint64_t>(fit, object.mesh.vertexCount())) return count;
  call.refuse(name, "refused: the scene is full; clear or remove objects first", " object ", object.id,
              ", vertex ", std::max(start, fit), ", limit ", inAll, " triangles in all objects");
  return start < fit ? fit - start : 0;
}

void ObjectTable::closeGap(Object& object, std::size_t count) {
  count = std::min(count, object.gap);
  object.gap -= count;
  gaps_ -= count;
}

void ObjectTable::meshEdited(Object& object, const Call& call) {
  if (!object.mesh.due()) return;
  object.meshSetBy = call.client;
  if (call.inBatch) object.mesh.finish();
  if (object.meshQueued) return;
  object.meshQueued = true;
  edited_.push_back(object.id);
}

template <>
void ObjectTable::handle(SetObjectNumber& c, const Call& call) {
  if (c.count < 0 || c.count > config_.limits.objects) {
    call.refuse("setObjectNumber", "refused: not a number of objects this server takes", " ", c.count,
                ", limit ", config_.limits.objects);
    return;
  }
  for (std::int32_t id = 0; id < c.count; ++id) {
    if (find(id) == nullptr) create(id, Object::kScene);
  }
}

template <>
void ObjectTable::handle(SetVertices& c, const Call& call) {
  constexpr std::string_view kName = "setObjectVertex";
  Object* object = find(c.object, kName, call);
  if (object == nullptr || c.positions.empty()) return;
  const std::size_t before = object->mesh.vertexCount();
  const std::size_t trianglesBefore = object->mesh.triangleCount();
  const std::size_t gap = object->gap;
  const std::size_t room = roomFor(*object, c.first, roomForTriples(*object, c, kName, call), before,
                                   config_.limits.verticesPerObject, config_.limits.verticesInAll, vertices_,
                                   kName, "vertex", call);
  if (room == 0) return;
  c.positions.resize(room);
  const RefusedVertices refused =
      object->mesh.setVertices(static_cast<std::uint32_t>(c.first), std::move(c.positions), call.now);
  if (refused.count > 0) {
    call.refuse(kName, "refused: a coordinate is not finite or too large; the vertex stays as it was",
                " object ", c.object, ", vertex ", c.first + refused.number, " at ",
                refused.position.transpose(),
                refused.count > 1 ? " and " + std::to_string(refused.count - 1) + " more" : "");
  }
  if (object->mesh.vertexCount() == before && object->gap > gap) closeGap(*object, object->gap - gap);
  vertices_ += object->mesh.vertexCount() - before;
  triangles_ += object->mesh.triangleCount() - trianglesBefore;
  meshEdited(*object, call);
}

// Those beside a refused one are accepted, as if they had come one by one.
template <>
void ObjectTable::handle(SetTriangles& c, const Call& call) {
  Object* object = find(c.object, kSetTriangle, call);
  if (object == nullptr || c.triangles.empty()) return;
  const auto isPossible = [this](const Triangle& t) {
    return *std::max_element(t.begin(), t.end()) < config_.limits.verticesPerObject;
  };
  const auto begin = c.triangles.begin();
  const auto end = c.triangles.end();
  const auto refused = std::find_if_not(begin, end, isPossible);
  if (refused == end || c.first < 0)
    return setTriangles(*object, c.first, std::move(c.triangles), c.makesMetres, call);
  const auto further = std::count_if(refused + 1, end, [&](const Triangle& t) { return !isPossible(t); });
  const auto number = [&](auto triangle) { return std::int64_t{c.first} + (triangle - begin); };
  call.refuse(kSetTriangle, "refused: no such vertex is possible", " object ", c.object, ", triangle ",
              number(refused), ", vertices ", static_cast<std::int32_t>((*refused)[0]), " ",
              static_cast<std::int32_t>((*refused)[1]), " ", static_cast<std::int32_t>((*refused)[2]),
              further > 0 ? ", and " + std::to_string(further) + " after it" : "");
  for (auto next = begin; next != end;) {
    const auto stop = std::find_if_not(next, end, isPossible);
    if (stop != next) setTriangles(*object, number(next), {next, stop}, c.makesMetres, call);
    next = std::find_if(stop, end, isPossible);
  }
}

void ObjectTable::setTriangles(Object& object, std::int64_t first, std::vector<Triangle> run,
                               bool makesMetres, const Call& call) {
  const std::size_t before = object.mesh.triangleCount();
  const std::size_t room = roomFor(object, first, run.size(), before, config_.limits.trianglesPerObject,
                                   config_.limits.trianglesInAll, triangles_, kSetTriangle, "triangle", call);
  if (room == 0) return;
  run.resize(room);
  if (makesMetres) becomeStock(object);
  object.mesh.setTriangles(static_cast<std::uint32_t>(first), run, call.now);
  triangles_ = triangles_ - before + object.mesh.triangleCount();
  meshEdited(object, call);
}

template <>
void ObjectTable::handle(SetNormal& c, const Call& call) {
  if (find(c.object, "setNormal", call) == nullptr) return;
  call.note("setNormal", "ignored: normals follow from the triangles", " object ", c.object);
}

template <>
void ObjectTable::handle(ContinueMesh& c, const Call& call) {
  Object* object = find(c.object, "mesh", call);
  if (object == nullptr) return;
  std::optional<Nanos> firstEdit;
  if (c.edited_ns >= 0) firstEdit = call.now - std::min<Nanos>(c.edited_ns, MeshDraft::kLongest);
  object->mesh.continueFrom(c.hasDeformed == 1, c.hasDeformed == 2, firstEdit, call.now);
  if (firstEdit) meshEdited(*object, call);
}

template <>
void ObjectTable::handle(PauseRebuilds& c, const Call& call) {
  rebuildNotBefore_ = call.now + std::clamp<Nanos>(c.pause_ns, 0, kLongestPause);
}

template <>
void ObjectTable::handle(ContinueCheck& c, const Call& call) {
  if (c.object < 0) return checks_.clear();
  const Object* object = find(c.object);
  const bool present = object != nullptr && object->geometry && c.isCurrent != 0;
  checks_.wait({call.now + std::clamp<Nanos>(c.due_ns, 0, kLongestPause), c.object,
                present ? object->geometry->topology : 0});
}

template <>
void ObjectTable::handle(RemoveTriangle& c, const Call& call) {
  constexpr std::string_view kName = "removeTriangle";
  Object* object = find(c.object, kName, call);
  if (object == nullptr) return;
  if (c.triangle < 0 || !object->mesh.removeTriangle(static_cast<std::uint32_t>(c.triangle), call.now)) {
    call.refuse(kName, "refused: no such triangle was set by setTriangle", " object ", c.object,
                ", triangle ", c.triangle);
    return;
  }
  meshEdited(*object, call);
}

template <>
void ObjectTable::handle(ClearMesh& c, const Call& call) {
  Object* object = find(c.object, "clearTrimesh", call);
  if (object == nullptr) return;
  vertices_ -= object->mesh.vertexCount();
  triangles_ -= object->mesh.triangleCount();
  object->mesh.clear(call.now);
  closeGap(*object, object->gap);
  meshEdited(*object, call);
}

template <>
void ObjectTable::handle(TransformMesh& c, const Call& call) {
  constexpr std::string_view kName = "transformTrimesh";
  Object* object = find(c.object, kName, call);
  if (object == nullptr) return;
  std::string flaw;
  const std::optional<Affine> t = affineFrom(fromRows(c.matrix), flaw);
  if (!t) {
    call.refuse(kName, kBadMatrix, " object ", c.object, ", ", flaw);
    return;
  }
  becomeStock(*object);
  object->asked.keep(c, call.client);
  const Nanos travel = object->poses.next(call.now);
  if (t->matrix() == object->T_object_mesh.matrix()) return;
  object->T_object_mesh = *t;
  moveAll(*object, travel);
}

template <>
void ObjectTable::handle(SetTrimeshType& c, const Call& call) {
  call.note("setTrimeshType", "ignored: there is one way to collide", " object ", c.object, ", type ",
            c.type);
}

template <>
void ObjectTable::handle(MoveToParent& c, const Call& call) {
  Object* object = find(c.object, "moveToParent", call);
  if (object == nullptr || !checkParent(c.object, c.parent, "moveToParent", call)) return;
  detach(*object);
  attach(*object, c.parent);
  moveAll(*object, 0);
}

template <>
void ObjectTable::handle(AddObject& c, const Call& call) {
  constexpr std::string_view kName = "addObject";
  if (c.object < 0 || c.object >= config_.limits.objects) {
    call.refuse(kName, "refused: not an object number this server takes", " object ", c.object, ", limit ",
                config_.limits.objects);
    return;
  }
  if (!checkParent(c.object, c.parent, kName, call)) return;
  if (find(c.object) == nullptr) {
    create(c.object, c.parent);
  } else if (find(c.object)->parent != c.parent) {
    MoveToParent move{c.object, c.parent};
    handle(move, call);
  }
  becomeStock(*find(c.object));
}

template <>
void ObjectTable::handle(AddObjectExScene& c, const Call& call) {
  constexpr std::string_view kName = "addObjectExScene";
  if (c.object < 0 || c.object >= config_.limits.objects) {
    call.refuse(kName, "refused: not an object number this server takes", " object ", c.object, ", limit ",
                config_.limits.objects);
    return;
  }
  if (find(c.object) == nullptr) {
    create(c.object, Object::kNoParent);
  } else {
    detach(*find(c.object));
    attach(*find(c.object), Object::kNoParent);
    moveAll(*find(c.object), 0);
  }
  becomeStock(*find(c.object));
}

template <>
void ObjectTable::handle(RemoveObject& c, const Call& call) {
  if (find(c.object, "removeObject", call) != nullptr) erase(c.object);
}

template <>
void ObjectTable::handle(SetTransform& c, const Call& call) {
  constexpr std::string_view kName = "setTransformMatrix";
  Object* object = find(c.object, kName, call);
  if (object == nullptr) return;
  std::string flaw;
  const std::optional<Affine> t = affineFrom(fromColumns(c.matrix), flaw);
  if (!t) {
    call.refuse(kName, kBadMatrix, " object ", c.object, ", ", flaw);
    return;
  }
  object->asked.keep(c, call.client);
  object->rotation = geometry::Quat::Identity();
  object->scale = Vec3::Ones();
  place(*object, *t, call);
}

template <>
void ObjectTable::handle(SetObjectPosition& c, const Call& call) {
  constexpr std::string_view kName = "setObjectPosition";
  Object* object = find(c.object, kName, call);
  if (object == nullptr) return;
  if (!isUsable(c.position_m)) {
    call.refuse(kName, "refused: not finite or too large", " object ", c.object, ", position ",
                c.position_m.transpose());
    return;
  }
  becomeStock(*object);
  object->asked.keep(c, call.client);
  Affine t = object->T_parent_object;
  t.translation() = c.position_m;
  place(*object, t, call);
}

template <>
void ObjectTable::handle(SetObjectOrientation& c, const Call& call) {
  constexpr std::string_view kName = "setObjectOrientation";
  Object* object = find(c.object, kName, call);
  if (object == nullptr) return;
  const std::optional<geometry::Quat> rotation = rotationFrom(c.axis, c.angle_rad);
  if (!rotation) {
    call.refuse(kName, "refused: axis or angle is not finite, or the axis is zero", " object ", c.object,
                ", axis ", c.axis.transpose(), ", angle ", c.angle_rad);
    return;
  }
  becomeStock(*object);
  object->asked.keep(c, call.client);
  object->rotation = *rotation;
  Affine t = object->T_parent_object;
  t.linear() = object->rotation.toRotationMatrix() * object->scale.asDiagonal();
  place(*object, t, call);
}

template <>
void ObjectTable::handle(SetObjectScale& c, const Call& call) {
  constexpr std::string_view kName = "setObjectScale";
  Object* object = find(c.object, kName, call);
  if (object == nullptr) return;
  Affine t = object->T_parent_object;
  t.linear() = object->rotation.toRotationMatrix() * c.scale.asDiagonal();
  if (!isInvertible(t)) {
    call.refuse(kName, "refused: a scale is zero, not finite, too large, or too small beside the others",
                " object ", c.object, ", scale ", c.scale.transpose());
    return;
  }
  becomeStock(*object);
  object->asked.keep(c, call.client);
  object->scale = c.scale;
  place(*object, t, call);
}

template <>
void ObjectTable::handle(SetTouchable& c, const Call& call) {
  Object* object = find(c.object, "setObjectIsTouchable", call);
  if (object == nullptr || object->touchable == c.touchable) return;
  object->asked.keep(c, call.client);
  object->touchable = c.touchable;
  queue(*object);
}

template <>
void ObjectTable::handle(SetObjectName& c, const Call& call) {
  Object* object = find(c.object, "setObjectName", call);
  if (object == nullptr) return;
  object->asked.keep(c, call.client);
  object->name = std::move(c.text);
}

template <>
void ObjectTable::handle(SetSurfaceProperty& c, const Call& call) {
  Object* object = find(c.object, "setHapticProperty", call);
  if (object == nullptr || !object->settings.set(c, config_, call)) return;
  object->asked.keep(c, call.client, SurfaceSettings::numberOf(c.name));
  object->surfaceSetBy = call.client;
  object->surfaceChanged = true;
  queue(*object);
}

template <>
void ObjectTable::handle(SetSurface& c, const Call& call) {
  Object* object = find(c.object, "updateTrimeshChanges", call);
  if (object == nullptr || !object->settings.set(c, config_, call)) return;
  becomeStock(*object);
  object->asked.keep(c, call.client);
  object->surfaceSetBy = call.client;
  object->surfaceChanged = true;
  queue(*object);
  if (object->mesh.due()) object->mesh.finish();
}

template <>
void ObjectTable::handle(SetSceneOrigin& c, const Call& call) {
  const std::optional<geometry::Quat> rotation = rotationFrom(c.axis, c.angle_rad);
  if (!rotation || !isUsable(c.position_m)) {
    call.refuse("setSceneOrigin", "refused: not finite or too large, or the axis is zero", " position ",
                c.position_m.transpose(), ", axis ", c.axis.transpose(), ", angle ", c.angle_rad);
    return;
  }
  asked_.keep(c, call.client);
  T_world_scene_ = Eigen::Translation3d(1000 * c.position_m) * *rotation;
  moveScene(scenePoses_.next(call.now));
}

void ObjectTable::apply(SceneCommand& command, const Call& call) {
  std::visit(
      [&]<class C>(C& c) {
        if constexpr (C::kInfo.target == Target::objects) handle(c, call);
      },
      command);
}

}  // namespace hapticd::scene

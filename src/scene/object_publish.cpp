// From edited objects to the list and the index that a snapshot shows.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/time.h"
#include "scene/object_table.h"

namespace hapticd::scene {
namespace {

constexpr Nanos kCheckSlice = 2'000'000;
constexpr double kFastestSweep_m_per_s = 1;
constexpr double kLongestMotion_m =
    0.020;  // beyond, the renderer takes a pose for a jump if it is near the hand

// The duration of a sweep over this distance; that of a jump does not depend on it.
Nanos shortestSweep(double distance_m) {
  return base::toNanos(std::min(distance_m, kLongestMotion_m) / kFastestSweep_m_per_s);
}

bool contains(const Box& outer, const Box& inner) {
  return (outer.min.array() <= inner.min.array()).all() && (inner.max.array() <= outer.max.array()).all();
}

// Objects that move get boxes with room for about a quarter of a second, so that the index over thousands of
// them is not rebuilt for each of their poses.
Box withRoom(const Object& object, const Box& swept) {
  const Motion& motion = object.motion;
  if (motion.origin().matrix() == motion.destination().matrix()) return swept;
  constexpr double kRoom_s = 0.25;
  const Vec3 centre = object.geometry->index.bounds().centre();
  const Vec3 way = motion.destination() * centre - motion.origin() * centre;
  const double ahead = std::clamp(kRoom_s / base::toSeconds(std::max<Nanos>(object.travel, 1)), 1.0, 64.0);
  Box box = swept;
  box.extend(Box{swept.min + ahead * way, swept.max + ahead * way});
  const Vec3 turning = 0.05 * swept.extents();
  return {box.min - turning, box.max + turning};
}

}  // namespace

Affine ObjectTable::frameOf(const Object& object) const {
  Affine local = object.T_parent_object;
  local.translation() *= object.worldUnits();
  if (const Object* parent = find(object.parent)) return frameOf(*parent) * local;
  return object.parent == Object::kScene ? Affine(T_world_scene_ * local) : local;
}

std::optional<Nanos> ObjectTable::oldestEdit() const {
  std::optional<Nanos> oldest;
  for (const std::int32_t id : edited_) {
    const Object* object = find(id);
    if (object == nullptr) continue;
    if (const auto edit = object->mesh.oldestEdit()) oldest = std::min(oldest.value_or(*edit), *edit);
  }
  return oldest;
}

std::optional<Nanos> ObjectTable::nextDeadline() const {
  std::optional<Nanos> next;
  for (const std::int32_t id : edited_) {
    const Object* object = find(id);
    std::optional<Nanos> due = object != nullptr ? object->mesh.due() : std::nullopt;
    if (!due) continue;
    if (object->mesh.hasBeenPublished() && !object->mesh.finished()) due = std::max(*due, rebuildNotBefore_);
    next = std::min(next.value_or(*due), *due);
  }
  if (const std::optional<Nanos> due = checks_.due()) {
    const Nanos at = std::max(*due, rebuildNotBefore_);
    next = std::min(next.value_or(at), at);
  }
  return next;
}

// A first upload is never delayed; rebuilding touchable meshes takes at most a quarter of the thread's time.
void ObjectTable::commitMeshes(Nanos now, NoticeBoard& board, std::vector<Notice>& out) {
  if (edited_.empty()) return;
  const Nanos started = stopwatch_();
  const auto worked = [&] { return now + (stopwatch_() - started); };
  const auto present = [&] { return now + (clock_() - started); };
  std::vector<std::int32_t> later;
  std::vector<Object*> committed;
  committed.reserve(edited_.size());
  for (const std::int32_t id : edited_) {
    Object* object = find(id);
    if (object == nullptr) continue;
    const std::optional<Nanos> due = object->mesh.due();
    const bool rebuild = object->mesh.hasBeenPublished() && !object->mesh.finished();
    if (due && (*due > now || (rebuild && worked() < rebuildNotBefore_))) {
      later.push_back(id);
      continue;
    }
    object->meshQueued = false;
    if (!due) continue;
    const Nanos begin = worked();
    try {
      commitMesh(*object, now, present(), committed);
    } catch (const std::exception& error) {
      object->mesh.giveUp();
      const Call call{object->meshSetBy, now, false, board, out};
      call.refuse("mesh", "could not be built, the previous one stays", " of object ", id, ", ",
                  error.what());
    }
    if (rebuild) rebuildNotBefore_ = worked() + 3 * (worked() - begin);
  }
  edited_ = std::move(later);
  beginMorphs(committed, present());
}

// Meshes that a client deforms together arrive together: no seam between them opens on the way.
void ObjectTable::beginMorphs(const std::vector<Object*>& committed, Nanos begin) {
  std::map<ClientId, Nanos> travel;
  for (const Object* object : committed) {
    const auto shortest = [scale = metresPerUnit(*object)](double distance) {
      return shortestSweep(distance * scale);
    };
    Nanos& longest = travel[object->meshSetBy];
    longest = std::max(longest, object->mesh.travel(begin, shortest));
  }
  for (Object* object : committed) {
    object->mesh.begin(begin, travel[object->meshSetBy]);
    unsettle(begin);
  }
}

// Movements end sooner than the longest interval; twice that, because a snapshot follows its commands.
void ObjectTable::unsettle(Nanos now) {
  constexpr Nanos kSettling = 2 * std::max(PoseStream::kLongestGap, MeshDraft::kLongestGap);
  published_.settledAt = std::max(published_.settledAt, now + kSettling);
}

double ObjectTable::metresPerUnit(const Object& object) const {
  return object.motion.destination().linear().colwise().norm().maxCoeff() / worldUnitsPerMetre_;
}

void ObjectTable::commitMesh(Object& object, Nanos now, Nanos clock, std::vector<Object*>& committed) {
  const std::uint64_t topology = object.geometry ? object.geometry->topology : 0;
  object.geometry = object.mesh.commit(clock, ++lastTopology_, config_.ballTool);
  committed.push_back(&object);  // before anything that may fail: it must begin
  object.stateChanged = true;
  queue(object);
  if (!config_.checkMeshes || !object.geometry || object.geometry->topology == topology) return;
  checks_.add(object.id, object.geometry->topology, now);
}

// Shares the quarter of the time with rebuilding.
void ObjectTable::checkMeshes(Nanos now, NoticeBoard& board, std::vector<Notice>& out) {
  const auto subject = [this](std::int32_t id, std::uint64_t topology) -> std::optional<MeshChecks::Subject> {
    const Object* object = find(id);
    if (object == nullptr || !object->geometry || object->geometry->topology != topology) return std::nullopt;
    const MeshDraft& mesh = object->mesh;
    return MeshChecks::Subject{object->geometry,
                               mesh.indexed() ? mesh.triangles() : *object->geometry->triangles,
                               metresPerUnit(*object)};
  };
  const auto report = [&](std::int32_t id, const std::string& text) {
    const Call call{find(id)->meshSetBy, now, false, board, out};
    call.post(Notice::Severity::normal, "mesh", "mesh of object " + std::to_string(id) + ": " + text);
  };
  const Nanos taken = checks_.run(now, subject, report);
  if (taken > kCheckSlice) rebuildNotBefore_ = now + 4 * taken;
}

// Null where it stays, or moves without a sweep.
std::optional<ObjectTable::Move> ObjectTable::moveOf(Object& object, const Call& call) {
  // A place beside the hand, seen from there, is known to 0.1 um.
  constexpr double kFarthest_m = 1e9;
  const Nanos now = call.now;
  Affine T_world_object = frameOf(object) * Eigen::UniformScaling<double>(object.worldUnits());
  T_world_object = T_world_object * object.T_object_mesh;
  const Affine& present = object.motion.destination();
  const bool first = object.motion.jumps() == 0;
  if (!isInvertible(T_world_object)) {
    call.warn("place", "out of range through its parents or the origin of the scene; it stays where it was",
              " of object ", object.id);
    return {};
  }
  if (const double distance_m = T_world_object.translation().norm() / worldUnitsPerMetre_;
      distance_m > kFarthest_m) {
    T_world_object.translation() *= kFarthest_m / distance_m;
    call.warn("place", "too far away; brought nearer, to a million kilometres", " of object ", object.id,
              ", ", distance_m, " m");
  }
  if (!first && T_world_object.matrix() == present.matrix()) return {};
  const bool sameHand = T_world_object.linear().determinant() * present.linear().determinant() > 0;
  object.stateChanged = true;
  // The way of an object that cannot be felt matters to nobody.
  if (first || !sameHand || object.travel == 0 || object.position < 0) {
    object.motion = Motion::fixed(T_world_object, ++jumps_);
    object.trail.clear();
    return {};
  }
  const Affine begin = object.motion.at(now);
  const Box bounds = object.geometry ? object.geometry->boundsAfter(now) : Box{};
  const auto sweep = [&](const Affine& from, const Affine& to) {
    return bounds.empty() ? 0 : shortestSweep(longestMove(from, to, bounds) / worldUnitsPerMetre_);
  };
  const Nanos travel = std::max(object.travel, sweep(begin, present) + sweep(present, T_world_object));
  return Move{&object, begin, T_world_object, bounds, std::min(travel, PoseStream::kLongestBlend), 0};
}

// Objects that a client moves together, by one map of the world, arrive together and stay together on the
// way: no gap opens between the parts of what turns.
void ObjectTable::updateMotions(Nanos now, NoticeBoard& board, std::vector<Notice>& out) {
  constexpr double kTogether_m = 0.5e-6;
  const double together = kTogether_m * worldUnitsPerMetre_;
  // Of those of one batch, so that thousands that move by themselves take no longer.
  const std::size_t mostLeaders =
      std::clamp<std::size_t>(65'536 / std::max<std::size_t>(changed_.size(), 1), 4, 64);
  struct Leader {
    std::size_t move;
    Affine map;  // of the world, by which it moves
  };
  std::vector<Move> moves;
  std::vector<Leader> leaders;
  for (const std::int32_t id : changed_) {
    Object* object = find(id);
    if (object == nullptr || !std::exchange(object->moved, false)) continue;
    unsettle(now);
    std::optional<Move> move = moveOf(*object, Call{object->meshSetBy, now, false, board, out});
    if (!move) continue;
    move->leader = moves.size();
    // One corner tells most objects apart.
    const Vec3 before = move->from * move->bounds.min;
    const Vec3 after = move->to * move->bounds.min;
    const auto asOne = [&](const Leader& leader) {
      const Vec3 there = leader.map.linear() * before + leader.map.translation();
      if ((there - after).squaredNorm() > 4 * together * together) return false;
      const Move& its = moves[leader.move];
      const Affine led = its.to * (its.from.inverse() * move->from);
      return longestMove(led, move->to, move->bounds) <= together;
    };
    const auto oldest = leaders.end() - static_cast<std::ptrdiff_t>(std::min(leaders.size(), mostLeaders));
    const auto leader = std::find_if(oldest, leaders.end(), asOne);
    if (leader == leaders.end()) {
      leaders.push_back({move->leader, move->to * move->from.inverse()});
    } else {
      move->leader = leader->move;
      moves[leader->move].travel = std::max(moves[leader->move].travel, move->travel);
    }
    moves.push_back(*move);
  }
  for (const Move& move : moves) {
    Motion& motion = move.object->motion;
    const Affine before = motion.destination();
    const Move& leader = moves[move.leader];
    motion = Motion::between(move.from, move.to, now, now + leader.travel, motion.jumps()).after(before);
    if (&leader != &move) motion.with(leader.object->motion);
  }
}

void ObjectTable::updateSurface(Object& object, Nanos now, NoticeBoard& board, std::vector<Notice>& out) {
  std::string remark;
  Surface surface = object.settings.resolve(bound_, remark);
  object.surfaceLoad_Ns_per_m = loadOf(surface, bound_);
  const double share = keepPassiveBeside(surface, freeLoad_Ns_per_m_, bound_);
  if (!remark.empty() && remark != object.surfaceRemark) {
    const Call call{object.surfaceSetBy, now, false, board, out};
    call.post(Notice::Severity::warning, "surface",
              "surface of object " + std::to_string(object.id) + ": " + remark);
  }
  if (const long percent = std::lround(100 * share); percent < 100) {
    const Call call{object.surfaceSetBy, now, false, board, out};
    call.warn("surface",
              "would be unstable on this device beside the effects and fields that run, and is lowered",
              " of object ", object.id, " to ", percent, " %");
  }
  object.surfaceRemark = remark;
  object.surface = surface;
  object.stateChanged = true;
}

// Only surfaces that it does or did lower are worked out anew.
void ObjectTable::spreadFreeLoad(double load_Ns_per_m) {
  const double before = std::exchange(freeLoad_Ns_per_m_, load_Ns_per_m);
  if (before == load_Ns_per_m) return;
  const double most = std::max(before, load_Ns_per_m);
  for (const auto& object : objects_) {
    if (!object || object->surfaceLoad_Ns_per_m == 0) continue;
    if (bound_.shareOf(object->surfaceLoad_Ns_per_m + most) == 1) continue;
    object->surfaceChanged = true;
    queue(*object);
  }
}

void ObjectTable::updateHeaviest() {
  heaviestSurface_Ns_per_m_ = 0;
  for (const auto& state : published_.objects)
    heaviestSurface_Ns_per_m_ = std::max(heaviestSurface_Ns_per_m_, find(state->id)->surfaceLoad_Ns_per_m);
}

bool ObjectTable::publish(Nanos now, double worldUnitsPerMetre, double freeLoad_Ns_per_m, NoticeBoard& board,
                          std::vector<Notice>& out) {
  worldUnitsPerMetre_ = worldUnitsPerMetre;
  spreadFreeLoad(freeLoad_Ns_per_m);
  commitMeshes(now, board, out);
  if (checks_.due().value_or(now + 1) <= now && rebuildNotBefore_ <= now) checkMeshes(now, board, out);
  return updatePublished(now, board, out);
}

bool ObjectTable::updatePublished(Nanos now, NoticeBoard& board, std::vector<Notice>& out) {
  spreadMoves();
  updateMotions(now, board, out);
  bool changed = false;
  bool loadsChanged = false;
  for (const std::int32_t id : changed_) {
    Object* object = find(id);
    if (object == nullptr || !object->queued) continue;
    object->queued = false;
    if (object->surfaceChanged) {
      updateSurface(*object, now, board, out);
      loadsChanged = true;
    }
    object->surfaceChanged = false;
    const bool listed = object->position >= 0;
    if (listed != object->isTouchable()) {
      listChanged_ = true;
    } else if (listed && object->stateChanged) {
      replaceState(*object, now);
      changed = true;
    }
  }
  changed_.clear();
  if (listChanged_) {
    rebuildList(now);
    changed = loadsChanged = true;
  }
  if (loadsChanged) updateHeaviest();
  if (indexStale_) rebuildIndex();
  return changed;
}

void ObjectTable::replaceState(Object& object, Nanos now) {
  object.state = std::make_shared<const ObjectState>(
      ObjectState{object.id, object.geometry, object.motion, object.surface});
  object.stateChanged = false;
  const auto position = static_cast<std::size_t>(object.position);
  published_.objects[position] = object.state;
  const Box swept = object.motion.sweep(object.geometry->index.bounds());
  const Box before = object.trail.around(now);
  object.trail.add(swept, now);
  if (contains(boxes_[position], swept)) return;
  boxes_[position] = withRoom(object, swept);
  boxes_[position].extend(before);
  indexStale_ = true;
}

void ObjectTable::rebuildList(Nanos now) {
  published_.objects.clear();
  boxes_.clear();
  for (const auto& object : objects_) {
    if (!object) continue;
    if (!object->isTouchable()) {
      object->position = -1;
      object->state.reset();
      object->stateChanged = true;
      continue;
    }
    object->position = static_cast<std::int64_t>(published_.objects.size());
    published_.objects.push_back(object->state);
    boxes_.emplace_back();
    if (object->stateChanged) {
      replaceState(*object, now);
    } else {
      boxes_.back() = object->motion.sweep(object->geometry->index.bounds());
      boxes_.back().extend(object->trail.around(now));
    }
  }
  listChanged_ = false;
  indexStale_ = true;
}

void ObjectTable::rebuildIndex() {
  published_.index = std::make_shared<const SpatialIndex>(SpatialIndex::build(
      static_cast<std::uint32_t>(boxes_.size()), [this](std::uint32_t i) { return boxes_[i]; }));
  indexStale_ = false;
}

}  // namespace hapticd::scene

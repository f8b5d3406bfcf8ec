#include "realtime/render/object_distances.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "realtime/render/facet.h"

namespace hapticd::realtime {
namespace {

using geometry::Affine;

constexpr double kFarthest_m = 0.2;                // of a search for the surface
constexpr float kRounding_m = 2e-6F;               // of a bound with its travel, in floats
constexpr double kLongestTravel_m = 4;             // beyond, floats would be too coarse
constexpr double kLongestWorkspaceStep_m = 0.020;  // of the tool in the world; beyond, it counts as a jump
constexpr int kExaminations = 64;                  // in a tick, of bounds that have run out
constexpr int kUnknownExaminations = 32;           // in a tick, of objects without a bound
constexpr int kUnknownBoxes = 512;      // of these, whose boxes are looked at; beyond, they may be anywhere
constexpr int kTurns = 2;               // in a tick, of others
constexpr int kChangesFollowed = 1024;  // in a tick: the bounds of further objects that moved are lost
constexpr int kMostTriangles = 2048;    // in one examination; beyond, the object counts as touching

// How far a point of a ball is from where it was under another placement, at most. Cheaper than
// scene::longestMove(), because thousands of objects may move in one tick.
double moveBound(const Affine& from, const Affine& to, const Vec3& centre, double radius) noexcept {
  return (to * centre - from * centre).norm() + (to.linear() - from.linear()).norm() * radius;
}

}  // namespace

double stretchOf(const geometry::Mat3& m) noexcept {
  return std::sqrt((m.transpose() * m).cwiseAbs().rowwise().sum().maxCoeff());
}

// The tool in the frame of an object.
ObjectDistances::ToolInObject ObjectDistances::toolIn(const scene::ObjectState& state,
                                                      const Query& query) noexcept {
  const geometry::Box& box = state.mesh->index.bounds();
  const Affine T_object_device = (query.T_device_world * state.motion.at(query.now)).inverse();
  ToolInObject in;
  in.stretch = stretchOf(T_object_device.linear());
  in.exists = std::isfinite(in.stretch) && !box.empty();
  if (!in.exists) return in;
  in.position = T_object_device * query.tool;
  in.outside = (in.position - in.position.cwiseMax(box.min).cwiseMin(box.max)).norm();
  return in;
}

// The distance now, at least, and the least on the rest of its motion.
double ObjectDistances::examine(const scene::ObjectState& state, const Query& query,
                                double& later_m) const noexcept {
  const scene::MeshGeometry& mesh = *state.mesh;
  const ToolInObject in = toolIn(state, query);
  later_m = std::numeric_limits<double>::infinity();
  if (!in.exists) return later_m;
  double nearest = kFarthest_m * in.stretch;
  if (in.outside < nearest) {
    int visits = 0;
    mesh.indexAt(query.now).visitNearest(in.position, nearest, [&](std::uint32_t triangle) noexcept {
      if (++visits > kMostTriangles) {
        nearest = 0;
        return -1.0;
      }
      return nearest =
                 std::min(nearest, distanceFrom(discAround(mesh.corners(triangle, query.now)), in.position));
    });
  }
  const double distance_m = std::max(in.outside, nearest) / in.stretch;
  later_m = distance_m;
  const Affine placed = state.motion.at(query.now);
  if (state.motion.movingAfter(query.now)) {
    const geometry::Box& box = mesh.index.bounds();
    const double detour = state.motion.detour(box.centre(), 0.5 * box.extents().norm());
    later_m -= (scene::longestMove(placed, state.motion.destination(), box) + detour) * metresPerUnit_;
  }
  if (mesh.deformingAfter(query.now))
    later_m -= mesh.recentMove * (query.T_device_world * placed).linear().norm();
  return distance_m;
}

float ObjectDistances::boundAfterMove(const scene::ObjectState& before, const scene::ObjectState& now,
                                      float bound) const noexcept {
  const bool deformed = before.mesh != now.mesh;
  if ((deformed && before.mesh->topology != now.mesh->topology) ||
      before.motion.jumps() != now.motion.jumps())
    return kUnknown;
  const geometry::Box& box = now.mesh->index.bounds();
  const Vec3 centre = box.centre();
  const double radius = 0.5 * box.extents().norm();
  const Affine& from = before.motion.destination();
  // The bound holds up to the destination before; motions between may have been missed.
  double way = moveBound(from, now.motion.origin(), centre, radius) +
               moveBound(now.motion.origin(), now.motion.destination(), centre, radius) +
               now.motion.detour(centre, radius);
  if (deformed) way += now.mesh->recentMove * from.linear().norm();
  return std::max(0.0F, bound - static_cast<float>(way * metresPerUnit_) - kRounding_m);
}

// A workspace that keeps its scale moves the tool in the world. False when the distances are others now, or
// the tool arrives far away, where it may be inside of objects.
bool ObjectDistances::followWorkspace(const scene::SceneSnapshot& scene) noexcept {
  const Affine& then = scene_->workspace.T_device_world;
  const Affine& now = scene.workspace.T_device_world;
  workspaceMoved_ = then.matrix() != now.matrix();
  if (!workspaceMoved_) return true;
  constexpr double kSameScale = 1e-9;
  const geometry::Mat3 square = now.linear().transpose() * now.linear();
  const geometry::Mat3 squareThen = then.linear().transpose() * then.linear();
  const double way = (now * (then.inverse() * tool_) - tool_).norm();
  if (!((square - squareThen).norm() <= kSameScale * square.norm()) || !(way <= kLongestWorkspaceStep_m))
    return false;
  travel_ += way;
  return true;
}

float ObjectDistances::boundOf(double distance_m) const noexcept {
  const double within = std::clamp(distance_m, 0.0, 2 * kFarthest_m);
  return std::max(0.0F, static_cast<float>(travel_ + within) - kRounding_m);
}

// States are compared by address: the previous snapshot still lives. When nothing is known, the index says
// which objects are within the reach of the tool.
void ObjectDistances::follow(const scene::SceneSnapshot& scene, double reach_m) noexcept {
  const int count = static_cast<int>(std::min<std::size_t>(scene.objects.size(), kMaxTracked));
  metresPerUnit_ = 1 / scene.workspace.worldUnitsPerMetre;
  if (count_ > 0 && scene_ != nullptr && followWorkspace(scene)) {
    followObjects(scene);
  } else {
    std::fill_n(bounds_.begin(), count, boundOf(reach_m));
    for (int i = 0; i < count; ++i)
      states_[static_cast<std::size_t>(i)] = scene.objects[static_cast<std::size_t>(i)].get();
    const Affine& T_world_device = scene.workspace.T_world_device;
    const double worldReach = reach_m * stretchOf(T_world_device.linear());
    scene.objectIndex->visitNear(T_world_device * tool_, worldReach, [&](std::uint32_t i) noexcept {
      if (i < static_cast<std::uint32_t>(count)) bounds_[i] = kUnknown;
    });
  }
  count_ = count;
  scene_ = &scene;
}

// The bounds of unchanged objects stay, those of objects that moved or deformed fall by their ways. Both
// lists are in the order of ids.
void ObjectDistances::followObjects(const scene::SceneSnapshot& scene) noexcept {
  const int count = static_cast<int>(std::min<std::size_t>(scene.objects.size(), kMaxTracked));
  std::copy_n(bounds_.begin(), count_, boundsBefore_.begin());
  std::copy_n(states_.begin(), count_, statesBefore_.begin());
  int from = 0;
  int followed = 0;
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const scene::ObjectState* const state = scene.objects[k].get();
    states_[k] = state;
    bounds_[k] = kUnknown;
    // Lists in step up to here most probably go on so; to read the ids of thousands takes too long.
    if (followed >= kChangesFollowed && count - i == count_ - from) {
      const auto f = static_cast<std::size_t>(from++);
      if (statesBefore_[f] == state) bounds_[k] = boundsBefore_[f];
      continue;
    }
    while (from < count_ && statesBefore_[static_cast<std::size_t>(from)] != state &&
           statesBefore_[static_cast<std::size_t>(from)]->id < state->id)
      ++from;
    if (from == count_) continue;
    const auto f = static_cast<std::size_t>(from);
    if (statesBefore_[f] == state) {
      bounds_[k] = boundsBefore_[f];
      ++from;
    } else if (statesBefore_[f]->id == state->id) {
      if (followed++ < kChangesFollowed && boundsBefore_[f] != kUnknown)
        bounds_[k] = boundAfterMove(*statesBefore_[f], *state, boundsBefore_[f]);
      ++from;
    }
  }
}

// Most bounds are far beyond the limit: a loop without branches finds that out.
bool ObjectDistances::isBlockBeyond(int first, float limit) const noexcept {
  if (first + kBlock > count_) return false;
  float least = bounds_[static_cast<std::size_t>(first)];
  for (int i = 1; i < kBlock; ++i) {
    const float bound = bounds_[static_cast<std::size_t>(first + i)];
    least = bound < least ? bound : least;
  }
  return least > limit;
}

// Keeps the nearest, first of those that were examined: what the tool touches is among them. A candidate
// without room limits how far the tool may move.
void ObjectDistances::consider(Nearest& nearest, const Candidate& candidate) const noexcept {
  const auto before = [](const Candidate& a, const Candidate& b) {
    return std::tie(a.isBound, a.distance_m, a.object) < std::tie(b.isBound, b.distance_m, b.object);
  };
  const auto begin = nearest.candidates.begin();
  auto end = begin + nearest.count;
  const auto place = std::upper_bound(begin, end, candidate, before);
  if (nearest.count == kRoom) {
    const double lost = place == end ? candidate.distance_m : (end - 1)->distance_m;
    nearest.free_m = std::min(nearest.free_m, lost);
    if (place == end) return;
    --end;
  } else {
    ++nearest.count;
  }
  std::move_backward(place, end, end + 1);
  *place = candidate;
}

// Those with the least bounds come first, for they limit the way of the tool; of equal ones, another in each
// tick.
int ObjectDistances::chooseDue(int due) noexcept {
  if (due <= kExaminations) return due;
  const auto fromTurn = [&](std::uint16_t i) { return i > turn_ ? i - turn_ : i - turn_ + count_; };
  const auto before = [&](std::uint16_t a, std::uint16_t b) {
    return std::pair(bounds_[a], fromTurn(a)) < std::pair(bounds_[b], fromTurn(b));
  };
  const auto begin = due_.begin();
  std::nth_element(begin, begin + kExaminations, begin + due, before);
  return kExaminations;
}

void ObjectDistances::examineAt(int i, const Query& query, Nearest& nearest) noexcept {
  const auto k = static_cast<std::size_t>(i);
  const bool fresh = bounds_[k] == kUnknown;
  double later_m = 0;
  const double distance_m = examine(*states_[k], query, later_m);
  bounds_[k] = boundOf(later_m);
  // One that moved may have passed over the tool, and one that appeared may be around it.
  const bool moved = workspaceMoved_ || states_[k]->motion.movingAfter(query.before) ||
                     states_[k]->mesh->deformingAfter(query.before);
  if (fresh || distance_m <= query.reach_m || moved)
    consider(nearest, {distance_m, static_cast<std::uint32_t>(i), fresh, false});
}

// The `number`th object without a bound, from 0. One whose box is around the tool may be around it, too, and
// stays unknown; of one that moves, the box is not enough.
void ObjectDistances::meetUnknown(int i, int number, const Query& query, Nearest& nearest) noexcept {
  if (number < kUnknownExaminations) return examineAt(i, query, nearest);
  if (number >= kUnknownBoxes) {
    nearest.free_m = 0;
    return;
  }
  const auto k = static_cast<std::size_t>(i);
  const scene::ObjectState& state = *states_[k];
  double box_m = 0;
  if (!state.motion.movingAfter(query.now) && !state.mesh->deformingAfter(query.now)) {
    const ToolInObject in = toolIn(state, query);
    box_m = in.exists ? in.outside / in.stretch : std::numeric_limits<double>::infinity();
  }
  if (box_m > 0) bounds_[k] = boundOf(box_m);
  if (box_m <= query.reach_m) consider(nearest, {box_m, static_cast<std::uint32_t>(i), true, true});
}

// Those whose bounds have run out.
void ObjectDistances::examineDue(int due, const Query& query, Nearest& nearest) noexcept {
  const int examined = chooseDue(due);
  for (int n = 0; n < due; ++n) {
    const int i = due_[static_cast<std::size_t>(n)];
    if (n < examined) {
      examineAt(i, query, nearest);
    } else {
      const double bound_m = bounds_[static_cast<std::size_t>(i)] - travel_;
      consider(nearest, {std::max(0.0, bound_m), static_cast<std::uint32_t>(i), false, true});
    }
  }
}

void ObjectDistances::followTool(const Vec3& tool) noexcept {
  travel_ += (tool - tool_).norm();
  tool_ = tool;
  if (travel_ <= kLongestTravel_m) return;
  for (int i = 0; i < count_; ++i) {
    float& bound = bounds_[static_cast<std::size_t>(i)];
    if (bound != kUnknown) bound = std::max(0.0F, bound - static_cast<float>(travel_) - kRounding_m);
  }
  travel_ = 0;
}

void ObjectDistances::findNearest(const scene::SceneSnapshot& scene, Nanos now, Nanos before,
                                  const Vec3& tool, double reach_m, Nearest& nearest) noexcept {
  nearest.count = 0;
  nearest.free_m = std::numeric_limits<double>::infinity();
  nearest.complete = scene.objects.size() <= kMaxTracked;
  if (count_ == 0) tool_ = tool;
  workspaceMoved_ = false;
  if (&scene != scene_ || count_ == 0) follow(scene, reach_m);
  followTool(tool);
  const Query query{scene.workspace.T_device_world, now, before, tool, reach_m};
  const auto limit = static_cast<float>(travel_ + reach_m) + kRounding_m;
  int due = 0;
  int unknown = 0;
  for (int i = 0; i < count_; ++i) {
    if (i % kBlock == 0 && isBlockBeyond(i, limit)) {
      i += kBlock - 1;
      continue;
    }
    const float bound = bounds_[static_cast<std::size_t>(i)];
    if (bound > limit) continue;
    if (bound == kUnknown) {
      meetUnknown(i, unknown++, query, nearest);
    } else {
      due_[static_cast<std::size_t>(due++)] = static_cast<std::uint16_t>(i);
    }
  }
  examineDue(due, query, nearest);
  // Bounds of objects that rest around the tool would otherwise run out at the same time.
  for (int i = 0; i < kTurns && unknown == 0 && count_ > 0; ++i) {
    turn_ = (turn_ + 1) % count_;
    if (bounds_[static_cast<std::size_t>(turn_)] > limit) examineAt(turn_, query, nearest);
  }
}

}  // namespace hapticd::realtime

#include "realtime/render/object_distances.h"

#include <algorithm>
#include <cmath>
#include <tuple>

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
constexpr int kTurns = 2;                          // in a tick, of others
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

// The distance now, at least, and the least on the rest of its motion.
double ObjectDistances::examine(const scene::ObjectState& state, const Affine& T_device_world, Nanos now,
                                const Vec3& tool, double& later_m) const noexcept {
  const scene::MeshGeometry& mesh = *state.mesh;
  const geometry::Box& box = mesh.index.bounds();
  const Affine placed = state.motion.at(now);
  const Affine T_object_device = (T_device_world * placed).inverse();
  const double stretch = stretchOf(T_object_device.linear());
  later_m = std::numeric_limits<double>::infinity();
  if (!std::isfinite(stretch) || box.empty()) return later_m;
  const Vec3 p = T_object_device * tool;
  const double outside = (p - p.cwiseMax(box.min).cwiseMin(box.max)).norm();
  double nearest = kFarthest_m * stretch;
  if (outside < nearest) {
    int visits = 0;
    mesh.index.visitNearest(p, nearest, [&](std::uint32_t triangle) noexcept {
      if (++visits > kMostTriangles) {
        nearest = 0;
        return -1.0;
      }
      const scene::Corners now_ = mesh.corners(triangle, now);
      return nearest = std::min(nearest, distanceBound(now_, p));
    });
  }
  const double distance_m = std::max(outside, nearest) / stretch;
  later_m = distance_m;
  if (state.motion.movingAfter(now)) {
    const double detour = state.motion.detour(box.centre(), 0.5 * box.extents().norm());
    later_m -= (scene::longestMove(placed, state.motion.destination(), box) + detour) * metresPerUnit_;
  }
  if (mesh.deformingAfter(now)) later_m -= mesh.recentMove * (T_device_world * placed).linear().norm();
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

// States are compared by address: the previous snapshot still lives.
void ObjectDistances::follow(const scene::SceneSnapshot& scene) noexcept {
  const int count = static_cast<int>(std::min<std::size_t>(scene.objects.size(), kMaxTracked));
  metresPerUnit_ = 1 / scene.workspace.worldUnitsPerMetre;
  if (count_ > 0 && scene_ != nullptr && followWorkspace(scene)) {
    followObjects(scene);
  } else {
    std::fill_n(bounds_.begin(), count, kUnknown);
    for (int i = 0; i < count; ++i)
      states_[static_cast<std::size_t>(i)] = scene.objects[static_cast<std::size_t>(i)].get();
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

// Keeps the nearest; a candidate without room limits how far the tool may move.
void ObjectDistances::consider(Nearest& nearest, const Candidate& candidate) const noexcept {
  const auto before = [](const Candidate& a, const Candidate& b) {
    return std::tie(a.distance_m, a.object) < std::tie(b.distance_m, b.object);
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

void ObjectDistances::findNearest(const scene::SceneSnapshot& scene, Nanos now, Nanos before,
                                  const Vec3& tool, double reach_m, Nearest& nearest) noexcept {
  nearest.count = 0;
  nearest.free_m = std::numeric_limits<double>::infinity();
  nearest.complete = scene.objects.size() <= kMaxTracked;
  if (count_ == 0) tool_ = tool;
  workspaceMoved_ = false;
  if (&scene != scene_ || count_ == 0) follow(scene);
  travel_ += (tool - tool_).norm();
  tool_ = tool;
  if (travel_ > kLongestTravel_m) {
    for (int i = 0; i < count_; ++i) {
      float& bound = bounds_[static_cast<std::size_t>(i)];
      if (bound != kUnknown) bound = std::max(0.0F, bound - static_cast<float>(travel_) - kRounding_m);
    }
    travel_ = 0;
  }
  const auto limit = static_cast<float>(travel_ + reach_m) + kRounding_m;
  int examinations = 0;
  int unknown = 0;
  const auto examineAt = [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    const bool fresh = bounds_[k] == kUnknown;
    double later_m = 0;
    const double distance_m = examine(*states_[k], scene.workspace.T_device_world, now, tool, later_m);
    bounds_[k] = static_cast<float>(travel_ + std::clamp(later_m, 0.0, 2 * kFarthest_m)) - kRounding_m;
    bounds_[k] = std::max(0.0F, bounds_[k]);
    // One that moved may have passed over the tool, and one that appeared may be around it.
    const bool moved =
        workspaceMoved_ || states_[k]->motion.movingAfter(before) || states_[k]->mesh->deformingAfter(before);
    if (fresh || distance_m <= reach_m || moved)
      consider(nearest, {distance_m, static_cast<std::uint32_t>(i), fresh});
  };
  for (int i = 0; i < count_; ++i) {
    if (i % kBlock == 0 && isBlockBeyond(i, limit)) {
      i += kBlock - 1;
      continue;
    }
    const auto k = static_cast<std::size_t>(i);
    if (bounds_[k] > limit) continue;
    if (bounds_[k] == kUnknown) {
      if (++unknown <= kUnknownExaminations) {
        examineAt(i);
      } else {
        nearest.complete = false;
      }
    } else if (++examinations <= kExaminations) {
      examineAt(i);
    } else {
      consider(nearest, {std::max(0.0, static_cast<double>(bounds_[k]) - travel_),
                         static_cast<std::uint32_t>(i), false});
    }
  }
  // Bounds of objects that rest around the tool would otherwise run out at the same time.
  for (int i = 0; i < kTurns && unknown == 0 && count_ > 0; ++i) {
    turn_ = (turn_ + 1) % count_;
    const auto k = static_cast<std::size_t>(turn_);
    if (bounds_[k] > limit) examineAt(turn_);
  }
}

}  // namespace hapticd::realtime

// The objects near the tool: where they are in this tick, how they moved, and which are left out.
#include "realtime/render/contact_query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "realtime/render/enclosure.h"
#include "realtime/render/view_motion.h"
#include "scene/motion.h"

namespace hapticd::realtime {
namespace {

using geometry::Mat3;
using scene::ObjectState;

constexpr double kRelativeSkin = 1e-9;      // of the largest coordinate of the object in the device frame
constexpr double kPadShare = 0x1p-22;       // of the object's size: a quarter of the padding of its index
constexpr double kRoundingFloor = 1e-12;    // of the largest coordinate: a thousand times its rounding error
constexpr double kSmallestObject_m = 1e-3;  // below this size the HIP's coordinates dominate the rounding

scene::Corners mapped(const Affine& t, const scene::Corners& c, bool mirrored) {
  scene::Corners out{t * c.a, t * c.b, t * c.c};
  if (mirrored) std::swap(out.b, out.c);
  return out;
}

bool reaches(const geometry::Box& box, const Vec3& p, double radius) {
  return ((p - box.centre()).cwiseAbs() - 0.5 * box.extents()).cwiseMax(0.0).squaredNorm() <= radius * radius;
}

}  // namespace

scene::Corners PlacedObject::corners(std::uint32_t triangle, Nanos now) const noexcept {
  return mapped(T_device_object, state->mesh->corners(triangle, now), mirrored);
}

scene::Corners PlacedObject::corners(const geometry::Triangle& triangle, Nanos now) const noexcept {
  return mapped(T_device_object, state->mesh->corners(triangle, now), mirrored);
}

scene::Corners PlacedObject::cornersBefore(std::uint32_t triangle, Nanos then) const noexcept {
  return mapped(T_device_objectBefore, before->mesh->corners(triangle, then), mirrored);
}

Vec3 PlacedObject::carried(const Vec3& p) const noexcept {
  if (!moved) return p;
  return T_device_object * (T_device_objectBefore.inverse() * p);
}

void ContactQuery::beginTick(const SceneAtTime& now, const SceneAtTime& before, const Vec3& tool,
                             const PlacedPlanes* planes) noexcept {
  now_ = now;
  tool_ = tool;
  planes_ = planes;
  before_ = before;
  sameWorkspace_ = before.scene != nullptr && before.scene->workspace.T_device_world.matrix() ==
                                                  now.scene->workspace.T_device_world.matrix();
  objectCount_ = skinCount_ = 0;
  freeTravel_ = std::numeric_limits<double>::infinity();
  minSkin_ = kRelativeSkin;
  radius_ = toolRadius_;
  overflowed_ = false;
  work_ = 0;
  facetCasts_ = 0;
  overlappedTriangleCount_ = 0;
  gatheredBefore_ = false;
  longestStep_m_ = std::numeric_limits<double>::infinity();
  if (now.scene == before.scene) return;
  ++generation_;
  allAppeared_ = allAppeared_ || before.scene == nullptr || before.scene->faces != now.scene->faces;
}

void ContactQuery::addObjectsNear(const Vec3& centre, double reach, const Vec3& tool) noexcept {
  const scene::SceneSnapshot& scene = *now_.scene;
  if (!scene.objectIndex || scene.objects.size() <= 2) {
    for (const auto& object : scene.objects) add(*object);
  } else {
    addObjectsByIndex(scene, centre, reach, tool);
  }
  dropStaleFacets();
}

void ContactQuery::leaveOutEnclosing(const Vec3& tool) noexcept {
  findEnclosing(tool);
  dropStaleFacets();
}

void ContactQuery::addObjectsByIndex(const scene::SceneSnapshot& scene, const Vec3& centre, double reach,
                                     const Vec3& tool) noexcept {
  if (crowd_ == scene.objects.size()) return addNearestObjects(scene, (centre - tool).norm() + reach, tool);
  // Once there is a crowd, one object more or less does not end it: all others would count as appeared.
  const std::size_t room = crowd_ > 0 ? ObjectDistances::kRoom / 2 : ObjectDistances::kRoom;
  const Affine& T_world_device = scene.workspace.T_world_device;
  const double largestRadius = std::max(toolRadius_, 0.5 * kLargestGapTolerance_m);
  const double worldReach = (reach + largestRadius) * kWiden * stretchOf(T_world_device.linear());
  std::array<std::uint32_t, kMaxObjects> found{};
  std::size_t count = 0;
  scene.objectIndex->visitNear(T_world_device * centre, worldReach, [&](std::uint32_t i) noexcept {
    if (count < found.size()) found[count] = i;
    ++count;
  });
  if (count > room) {
    crowd_ = scene.objects.size();
    return addNearestObjects(scene, (centre - tool).norm() + reach, tool);
  }
  if (std::exchange(crowd_, 0) != 0) distances_.restart();
  // By id, so that the proxy does not depend on the order of visits.
  std::sort(found.begin(), found.begin() + count);
  const Ball here{centre, reach};
  for (std::size_t k = 0; k < count; ++k) add(*scene.objects[found[k]], &here);
}

// More boxes around the tool than fit: the nearest surfaces, and the tool moves only as far as all are known.
void ContactQuery::addNearestObjects(const scene::SceneSnapshot& scene, double reach,
                                     const Vec3& tool) noexcept {
  ObjectDistances::Nearest nearest;
  distances_.findNearest(scene, now_.time, before_.time, tool, (reach + radius_) * kWiden, nearest);
  if (nearest.free_m < reach + radius_) {
    freeTravel_ = std::max(0.0, nearest.free_m - radius_);
    freeFrom_ = tool;
  }
  overflowed_ = overflowed_ || !nearest.complete || nearest.free_m < reach + radius_;
  std::sort(nearest.candidates.begin(), nearest.candidates.begin() + nearest.count,
            [](const auto& a, const auto& b) { return a.object < b.object; });
  for (int i = 0; i < nearest.count; ++i) {
    const auto& candidate = nearest.candidates[static_cast<std::size_t>(i)];
    const int before = objectCount_;
    add(*scene.objects[candidate.object]);
    if (candidate.fresh && objectCount_ > before) objects_[static_cast<std::size_t>(before)].before = nullptr;
  }
}

bool ContactQuery::shorten(const Vec3& p, Vec3& g) const noexcept {
  if (!std::isfinite(freeTravel_) || (g - freeFrom_).norm() <= freeTravel_) return false;
  if ((p - freeFrom_).norm() >= freeTravel_) {
    g = p;
  } else {
    g = p + exitOfBall(p, g - p, freeFrom_, freeTravel_) * (g - p);
  }
  return true;
}

// An object that appears around the tool would hold it inside: it cannot be felt until the tool has left it.
void ContactQuery::findEnclosing(const Vec3& tool) noexcept {
  const auto appeared = [all = std::exchange(allAppeared_, false)](const PlacedObject& placed) {
    return all || placed.before == nullptr || placed.jumped;
  };
  const auto end = objects_.begin() + objectCount_;
  leftOutChanged_ = false;
  enclosureVisits_ = 0;
  if (enclosingCount_ == 0) enclosureRests_ = 0;
  if (enclosingCount_ == 0 && std::none_of(objects_.begin(), end, appeared)) return;
  const auto known = enclosing_;
  const auto knownEnd = known.begin() + enclosingCount_;
  enclosingCount_ = 0;
  // In a crowd, an object whose surface is far may still be around the tool.
  for (auto id = known.begin(); crowd_ > 0 && id != knownEnd; ++id) {
    const bool here =
        std::any_of(objects_.begin(), end, [&](const PlacedObject& o) { return o.state->id == *id; });
    if (!here && now_.scene->find(*id) != nullptr)
      enclosing_[static_cast<std::size_t>(enclosingCount_++)] = *id;
  }
  constexpr int kRests = 15;  // ticks after one whose budget did not suffice: the next one would hardly do
  const bool rests = enclosureRests_ > 0;
  enclosureRests_ -= rests ? 1 : 0;
  EnclosureBudget budget;
  const double ballRadius = keepsFacets_ ? 0 : radius_;
  int kept = 0;
  for (auto placed = objects_.begin(); placed != end; ++placed) {
    const std::int32_t id = placed->state->id;
    const bool around =
        std::find(known.begin(), knownEnd, id) != knownEnd
            ? rests || !hasLeft(*placed, faces(), now_.time, tool, ballRadius, budget)
            : appeared(*placed) && encloses(*placed, faces(), now_.time, tool, ballRadius, budget);
    if (around && enclosingCount_ < kMaxObjects) {
      enclosing_[static_cast<std::size_t>(enclosingCount_++)] = id;
      continue;
    }
    if (std::find(known.begin(), knownEnd, id) != knownEnd) placed->before = nullptr;
    PlacedObject& target = objects_[static_cast<std::size_t>(kept++)];
    if (&target != &*placed) target = *placed;
  }
  objectCount_ = kept;
  enclosureVisits_ = EnclosureBudget{}.visits - budget.visits;
  if (budget.visits <= 0) enclosureRests_ = kRests;
  leftOutChanged_ =
      !std::equal(known.begin(), knownEnd, enclosing_.begin(), enclosing_.begin() + enclosingCount_);
}

void ContactQuery::leaveOut(int object) noexcept {
  if (enclosingCount_ == kMaxObjects) return;
  const auto at = objects_.begin() + object;
  enclosing_[static_cast<std::size_t>(enclosingCount_++)] = at->state->id;
  std::move(at + 1, objects_.begin() + objectCount_, at);
  --objectCount_;
  leftOutChanged_ = true;
  dropStaleFacets();
}

int ContactQuery::addObject(std::int32_t id) noexcept {
  const ObjectState* state = now_.scene->find(id);
  if (state == nullptr) return -1;
  add(*state);
  for (int i = 0; i < objectCount_; ++i) {
    if (object(i).state == state) return i;
  }
  return -1;
}

// Only the part of `here`, if it is given, counts for the smallest skin: the index keeps room for ways of
// before, and a recording that begins later has another one.
void ContactQuery::add(const ObjectState& state, const Ball* here) noexcept {
  for (int i = 0; i < objectCount_; ++i) {
    if (object(i).state == &state) return;
  }
  if (objectCount_ == kMaxObjects) {
    overflowed_ = true;
    return;
  }
  PlacedObject& placed = objects_[static_cast<std::size_t>(objectCount_)];
  if (placed.restGeneration == generation_ && placed.state == &state) {
    placed.before = &state;
    placed.T_device_objectBefore = placed.T_device_object;
    placed.moved = placed.deformed = placed.jumped = false;
  } else {
    if (!place(state, placed)) return;
    compareWithBefore(placed);
    if (placed.atRest) placed.restGeneration = generation_;
  }
  ++objectCount_;
  radius_ = std::max(radius_, placed.radius);
  if (here != nullptr && !isNear(placed, *here) && !wasNear(placed, *here)) return;
  minSkin_ = skinCount_++ == 0 ? placed.skin : std::min(minSkin_, placed.skin);
}

bool ContactQuery::isNear(const PlacedObject& placed, const Ball& ball) const noexcept {
  return reaches(placed.state->mesh->boundsAfter(now_.time), placed.T_object_device * ball.centre,
                 (ball.radius + placed.radius) * placed.stretch);
}

bool ContactQuery::wasNear(const PlacedObject& placed, const Ball& ball) const noexcept {
  if (placed.before == nullptr || placed.rests()) return false;
  const Affine T_object_device = placed.T_device_objectBefore.inverse();
  return reaches(placed.before->mesh->boundsAfter(before_.time), T_object_device * ball.centre,
                 (ball.radius + placed.radius) * stretchOf(T_object_device.linear()));
}

bool ContactQuery::place(const ObjectState& state, PlacedObject& placed) const noexcept {
  placed = PlacedObject{};
  placed.state = &state;
  // Not those of the index, which remember the shapes before.
  const geometry::Box& box = state.mesh->boundsAfter(now_.time);
  if (box.empty()) return false;
  placed.T_device_object = now_.scene->workspace.T_device_world * state.motion.at(now_.time);
  placed.atRest = !state.motion.movingAfter(now_.time) && !state.mesh->deformingAfter(now_.time);
  const Mat3 linear = placed.T_device_object.linear();
  const double determinant = linear.determinant();
  placed.mirrored = determinant < 0;
  placed.T_object_device = placed.T_device_object.inverse();
  placed.stretch = stretchOf(placed.T_object_device.linear());
  placed.metresPerUnit = stretchOf(linear);
  placed.stretchAlong = placed.T_object_device.linear().rowwise().norm();
  if (!std::isfinite(placed.stretch) || determinant == 0) return false;  // flattened by its placement
  const Vec3 farthest =
      (placed.T_device_object * box.centre()).cwiseAbs() + linear.cwiseAbs() * (0.5 * box.extents());
  const double extent = std::max(farthest.maxCoeff(), kSmallestObject_m);
  const double size = 0.5 * box.extents().maxCoeff() / placed.stretch;
  placed.skin = std::max(std::min(kRelativeSkin * extent, kPadShare * size), kRoundingFloor * extent);
  // Two objects that meet were rounded to floats in frames of their own: a gap grows with the coordinates on
  // the device as well as with those of the object's own frame.
  const Vec3 largest = linear.cwiseAbs() * box.min.cwiseAbs().cwiseMax(box.max.cwiseAbs());
  placed.radius = std::max(toolRadius_, 0.5 * geometry::gapToleranceOf(std::max(extent, largest.maxCoeff())));
  return std::isfinite(placed.skin);
}

void ContactQuery::compareWithBefore(PlacedObject& placed) const noexcept {
  if (before_.scene == nullptr) return;
  const ObjectState& state = *placed.state;
  placed.before = before_.scene->find(state.id);
  if (placed.before == nullptr) return;
  const ObjectState& before = *placed.before;
  placed.T_device_objectBefore = placed.T_device_object;
  if (!sameWorkspace_ || placed.before != &state || state.motion.movingAfter(before_.time)) {
    placed.T_device_objectBefore = before_.scene->workspace.T_device_world * before.motion.at(before_.time);
    placed.moved = placed.T_device_objectBefore.matrix() != placed.T_device_object.matrix();
  }
  const bool sameTriangles = before.mesh->topology == state.mesh->topology;
  placed.deformed = sameTriangles && (before.mesh != state.mesh || state.mesh->deformingAfter(before_.time));
  placed.jumped = !sameTriangles || before.motion.jumps() != state.motion.jumps() || viewJumped(placed);
}

// A workspace is not interpolated: what moves a little near the tool is a motion within this tick.
bool ContactQuery::viewJumped(const PlacedObject& placed) const noexcept {
  if (sameWorkspace_) return false;
  const std::array<Affine, 2> places{placed.T_device_objectBefore, placed.T_device_object};
  const geometry::Box near = scene::partNear(placed.state->mesh->index.bounds(), places, tool_, kNear_m);
  return !near.empty() && scene::longestMove(places[0], places[1], near) > kLongestMotion_m;
}

}  // namespace hapticd::realtime

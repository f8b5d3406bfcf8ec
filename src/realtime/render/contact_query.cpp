#include "realtime/render/contact_query.h"

#include "realtime/render/enclosure.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

namespace hapticd::realtime {
namespace {

using geometry::Mat3;
using scene::ObjectState;

constexpr double kRelativeSkin = 1e-9;      // of the largest coordinate of the object in the device frame
constexpr double kPadShare = 0x1p-22;       // of the object's size: a quarter of the padding of its index
constexpr double kRoundingFloor = 1e-12;    // of the largest coordinate: a thousand times its rounding error
constexpr double kSmallestObject_m = 1e-3;  // below this size the HIP's coordinates dominate the rounding
constexpr double kWiden = 1 + 1e-6;         // covers the rounding of queries that change frames
// By how much joined triangles may be off (see geometry/fans.h), and more by a share of the tool radius: far
// less than the gap tolerance, and than anybody feels.
constexpr double kFanError_m = 1e-7;
constexpr double kFanErrorShare = 5e-4;
constexpr double kSmallestGather_m = 10e-6;
constexpr double kSmallestWay_m = 1e-6;
constexpr double kHalfWay = 0.6;   // half of the way of a tick, and what it bends aside
constexpr double kBallWay = 0.7;   // the same for a ball, whose last steps may lead beyond its rest
constexpr double kAside = 0.05;    // of a way that is gathered: how far a ball may leave it
constexpr double kWholeWay = 1.1;  // of a tick, and a little more
constexpr double kShortestWay = 0.01;
constexpr int kFewAlongWay = 64;  // triangles: then a ball of the same margin fits, too
constexpr double kManyWays = 4;   // a reserve for fewer is no less work than to gather each
constexpr int kReuseLimit = 32;   // reuse the cached facets up to this count instead of querying again

scene::Corners mapped(const Affine& t, const scene::Corners& c, bool mirrored) {
  scene::Corners out{t * c.a, t * c.b, t * c.c};
  if (mirrored) std::swap(out.b, out.c);
  return out;
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
  objectCount_ = 0;
  freeTravel_ = std::numeric_limits<double>::infinity();
  minSkin_ = kRelativeSkin;
  radius_ = toolRadius_;
  overflowed_ = false;
  work_ = 0;
  facetCasts_ = 0;
  gatheredBefore_ = false;
  longestStep_m_ = std::numeric_limits<double>::infinity();
  if (now.scene == before.scene) return;
  ++generation_;
  allAppeared_ = allAppeared_ || before.scene == nullptr || before.scene->faces != now.scene->faces;
}

void ContactQuery::forget() noexcept {
  cache_.invalidate();
  unfitCount_ = 0;
  joinedFans_ = false;
  roomyReach_m_ = fits_m_ = std::numeric_limits<double>::infinity();
  reserve_m_ = keepsFacets_ ? 0 : kReserveShare * toolRadius_;
  countBefore_ = fullReserves_ = 0;
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

void ContactQuery::dropStaleFacets() noexcept {
  if (gatheredGeneration_ == generation_ && sameObjects()) return;
  cache_.invalidate();
  unfitCount_ = 0;
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
  for (std::size_t k = 0; k < count; ++k) add(*scene.objects[found[k]]);
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
  EnclosureBudget budget;
  const double ballRadius = keepsFacets_ ? 0 : radius_;
  int kept = 0;
  for (auto placed = objects_.begin(); placed != end; ++placed) {
    const std::int32_t id = placed->state->id;
    const bool around =
        std::find(known.begin(), knownEnd, id) != knownEnd
            ? !hasLeft(*placed, faces(), now_.time, tool, ballRadius, budget)
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
  leftOutChanged_ =
      !std::equal(known.begin(), knownEnd, enclosing_.begin(), enclosing_.begin() + enclosingCount_);
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

void ContactQuery::add(const ObjectState& state) noexcept {
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
  minSkin_ = objectCount_ == 1 ? placed.skin : std::min(minSkin_, placed.skin);
  radius_ = std::max(radius_, placed.radius);
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

bool ContactQuery::isUneven(const PlacedObject& placed) noexcept {
  constexpr double kUneven = 0.8;
  return placed.stretchAlong.minCoeff() <= kUneven * placed.stretch;
}

// The index is asked for a ball in the object's frame, which is an ellipsoid in the device frame. Of the
// triangles of an object that is scaled unevenly, most are beyond the box around it.
bool ContactQuery::mayReach(const PlacedObject& placed, std::uint32_t triangle, const Vec3& inObject,
                            double reach_m) noexcept {
  if (!isUneven(placed)) return true;
  const scene::Corners k = placed.state->mesh->corners(triangle, now_.time);
  const Vec3 low = k.a.cwiseMin(k.b).cwiseMin(k.c);
  const Vec3 high = k.a.cwiseMax(k.b).cwiseMax(k.c);
  const Vec3 beyond = (low - inObject).cwiseMax(inObject - high);
  if (!(beyond.array() > reach_m * kWiden * placed.stretchAlong.array()).any()) return true;
  work_ += kBoxVisit;
  return false;
}

// The levels of the fans of one object near a way.
class ContactQuery::JoinedFans {
 public:
  JoinedFans(const PlacedObject& placed, Nanos now, const Vec3& from, const Vec3& to, double reach_m,
             double toolRadius_m) noexcept
      : mesh_(*placed.state->mesh),
        now_(now),
        from_(from),
        to_(to),
        reach_(reach_m * placed.stretch),
        error_((kFanError_m + kFanErrorShare * toolRadius_m) / std::max(placed.metresPerUnit, 1e-300)) {}

  /// Replaces a triangle of a fan by the one that it is joined to, or does nothing. False when that is here
  /// already, or else it may be, too.
  bool join(FacetCache::TriangleId& id) noexcept {
    const int fan = mesh_.fans->fanOf(id.triangle);
    if (fan != fan_) start(fan);
    if (level_ == 0) return true;
    const geometry::Fans::First first = mesh_.fans->firstOf(level_, id.triangle);
    id.triangle = first.triangle;
    id.level = static_cast<std::int16_t>(level_);
    if (first.place >= here_.size()) return true;
    const bool fresh = !here_[first.place];
    here_[first.place] = true;
    return fresh;
  }

  /// Whether any were joined.
  bool any() const noexcept { return any_; }

 private:
  void start(int fan) noexcept {
    fan_ = fan;
    level_ = 0;
    if (fan < 0) return;
    const Vec3 apex = mesh_.vertex(mesh_.fans->apexOf(fan), now_);
    const double distance = std::max((apex - from_).norm(), (apex - to_).norm());
    level_ = mesh_.fans->levelFor(fan, distance + reach_, error_);
    if (level_ > 0) here_.reset();
    any_ = any_ || level_ > 0;
  }

  const scene::MeshGeometry& mesh_;
  Nanos now_;
  Vec3 from_, to_;
  double reach_;
  double error_;
  int fan_ = -1;
  int level_ = 0;
  bool any_ = false;
  std::bitset<FacetCache::kMaxTriangles> here_;  // by their places
};

geometry::Triangle ContactQuery::verticesOf(const FacetCache::TriangleId& id) const noexcept {
  const scene::MeshGeometry& mesh = *object(id.object).state->mesh;
  return id.level == 0 ? (*mesh.triangles)[id.triangle] : mesh.fans->joined(id.level, id.triangle);
}

scene::Corners ContactQuery::cornersOf(const FacetCache::TriangleId& id) const noexcept {
  return object(id.object).corners(verticesOf(id), now_.time);
}

// Facets of objects at rest stay the same from tick to tick. Null for a degenerate triangle; valid until the
// next call.
const Facet* ContactQuery::facetOf(const FacetCache::TriangleId& id) const noexcept {
  const PlacedObject& placed = object(id.object);
  MemoFacet& memo = facetMemo_[(id.triangle * 0x9E3779B1U) >> (32 - kMemoBits)];
  if (memo.generation != generation_ || memo.state != placed.state || memo.facet.triangle != id.triangle ||
      memo.level != id.level) {
    memo.generation = 0;
    if (!keepsFacets_) work_ += kFacetVisit;
    if (!makeFacet(cornersOf(id), placed.skin, memo.facet)) return nullptr;
    memo.facet.triangle = id.triangle;
    memo.facet.radius = placed.radius;
    memo.state = placed.state;
    memo.level = id.level;
    if (placed.atRest) memo.generation = generation_;
  }
  memo.facet.object = id.object;
  return &memo.facet;
}

// A ball around one that did not fit does not fit either. A little less than around counts, too: the casts of
// a tick begin within micrometres of each other.
bool ContactQuery::isUnfit(const Vec3& centre, double radius) const noexcept {
  constexpr double kAround = 0.9;
  return std::any_of(
      unfit_.begin(), unfit_.begin() + std::min(unfitCount_, kMaxUnfit),
      [&](const Ball& ball) { return (ball.centre - centre).norm() + kAround * ball.radius <= radius; });
}

// As if the facets lay on a surface with as many in each part of it. Only where they are many: at a vertex, a
// smaller ball holds as many, and a larger one perhaps no more.
void ContactQuery::estimateRoom(double radius) noexcept {
  constexpr double kFew = 24;
  constexpr int kMany = 64;
  const int count = cache_.complete() ? std::max(cache_.size(), 1) : FacetCache::kMaxFacets;
  const double few_m = std::max(radius * std::sqrt(kFew / count), kSmallestGather_m);
  roomyReach_m_ = count > kMany ? few_m : std::max(roomyReach_m_, few_m);
}

// How much a ball tool gathers at once, as far as is known, also from the ticks before.
void ContactQuery::learnWhatFits(const Vec3& centre, double radius, bool overflowed) noexcept {
  constexpr int kFew = FacetCache::kMaxTriangles / 3;
  // Not where other gathers spent the work of the tick.
  if (overflowed || (!cache_.complete() && 2 * cache_.size() > FacetCache::kMaxTriangles)) {
    fits_m_ = std::max(0.5 * radius, kSmallestGather_m);
    if (canGatherFansAlongWays()) fits_m_ = kSmallestGather_m;
    while (fits_m_ > kSmallestGather_m && !discsFit(centre, fits_m_))
      fits_m_ = std::max(0.5 * fits_m_, kSmallestGather_m);
    reserve_m_ = std::min(reserve_m_, fits_m_);
    countBefore_ = FacetCache::kMaxTriangles;  // tells nothing of how few a smaller one leaves out
  } else if (cache_.complete() && cache_.size() < kFew && radius >= 0.5 * fits_m_) {
    fits_m_ *= 1.5;
  }
}

// Balls that fit beside fans would have to be found by trying.
bool ContactQuery::canGatherFansAlongWays() const noexcept {
  const auto end = objects_.begin() + objectCount_;
  return std::all_of(objects_.begin(), end, [this](const PlacedObject& o) { return hasDiscs(o); }) &&
         std::any_of(objects_.begin(), end,
                     [](const PlacedObject& o) { return o.state->mesh->fans != nullptr; });
}

// To find that out is far less work than to gather what then does not fit.
bool ContactQuery::discsFit(const Vec3& centre, double radius) noexcept {
  std::size_t all = 0;
  for (int i = 0; i < objectCount_; ++i) {
    const PlacedObject& placed = object(i);
    if (!hasDiscs(placed) || isPassable(i)) continue;
    int groups = 0;
    all += placed.state->mesh->discs->findNear(placed.T_object_device * centre, Vec3::Zero(),
                                               (radius + placed.radius) * placed.stretch, places_, groups);
    work_ += kBoxVisit * groups;
  }
  return all <= places_.size();
}

// A ball that slides over a surface meets as many triangles with any reserve; with a small one, no tick
// gathers many. In a hollow of about its own radius, a smaller one leaves out few.
void ContactQuery::adaptReserve() noexcept {
  constexpr int kMany = 1024;
  constexpr double kFewer = 0.7;
  constexpr int kTries = 32;  // gathers until a smaller one is tried again
  const double most = std::min(kReserveShare * toolRadius_, fits_m_);
  const int count = cache_.size();
  if (count < kMany / 4) {
    reserve_m_ = std::min(2 * reserve_m_, most);
  } else if (count > kMany && reserve_m_ < most && count > kFewer * countBefore_) {
    reserve_m_ = most;
    fullReserves_ = kTries;
  } else if (count > kMany && --fullReserves_ < 0) {
    reserve_m_ = std::max(0.5 * reserve_m_, kSmallestGather_m);
  }
  countBefore_ = count;
}

bool ContactQuery::gather(const Vec3& centre, double radius) noexcept {
  if (isUnfit(centre, radius)) {
    cache_.restart(centre, Vec3::Zero(), radius);
    gatheredBefore_ = true;
    joinedFans_ = false;
    cache_.invalidate();
    return false;
  }
  bool overflowed = false;
  gatherNear(centre, Vec3::Zero(), radius, overflowed);
  if (keepsFacets_) estimateRoom(radius);
  // Of what a ball is to pass nothing is here: that tells nothing of the next gathers.
  if (!keepsFacets_ && passable_ == 0) learnWhatFits(centre, radius, overflowed);
  if (radius == reserve_m_ && cache_.complete() && passable_ == 0) adaptReserve();
  if (!cache_.complete() && !workSpent())
    unfit_[static_cast<std::size_t>(unfitCount_++ % kMaxUnfit)] = {centre, std::min(radius, 2 * fits_m_)};
  return cache_.complete();
}

void ContactQuery::gatherNear(const Vec3& from, const Vec3& way, double radius, bool& overflowed) noexcept {
  cache_.restart(from, way, radius);
  gatheredBefore_ = true;
  joinedFans_ = false;
  // Beside fans, balls are gathered as if there were no discs: the levels follow from what they held.
  const bool byDiscs = !way.isZero(0) || !gathersBalls();
  bool reusable = true;
  for (int i = 0; i < objectCount_ && cache_.complete(); ++i) {
    const PlacedObject& placed = object(i);
    gatheredFrom_[static_cast<std::size_t>(i)] = placed.state;
    if (isPassable(i)) continue;
    reusable = reusable && placed.atRest && !placed.deformed;
    const double reach = radius + placed.radius + 4 * placed.skin;
    if (byDiscs && hasDiscs(placed)) {
      overflowed = !gatherByDiscs(i, from, way, reach);
    } else {
      gatherByIndex(i, from, way, reach);
    }
  }
  gatheredCount_ = objectCount_;
  gatheredGeneration_ = reusable ? generation_ : 0;
}

// The index knows no ways: around the middle of this one.
void ContactQuery::gatherByIndex(int i, const Vec3& from, const Vec3& way, double reach) noexcept {
  const PlacedObject& placed = object(i);
  const scene::MeshGeometry& mesh = *placed.state->mesh;
  const Vec3 start = placed.T_object_device * from;
  const Vec3 end = placed.T_object_device * Vec3(from + way);
  const Vec3 inObject = 0.5 * (start + end);
  const double around = reach + 0.5 * way.norm();
  std::optional<JoinedFans> fans;
  if (mesh.fans && !placed.deformed) fans.emplace(placed, now_.time, start, end, reach, toolRadius_);
  mesh.index.visitNear(inObject, around * kWiden * placed.stretch, [&](std::uint32_t triangle) noexcept {
    FacetCache::TriangleId id{triangle, static_cast<std::int16_t>(i), 0};
    if (fans && !fans->join(id)) {
      ++work_;
    } else if (placed.deformed || id.level > 0 || mayReach(placed, triangle, inObject, around)) {
      addToCache(id);
    }
    if (workSpent()) cache_.invalidate();
    return cache_.complete();
  });
  joinedFans_ = joinedFans_ || (fans && fans->any());
}

// False when they do not fit.
bool ContactQuery::gatherByDiscs(int i, const Vec3& from, const Vec3& way, double reach) noexcept {
  const PlacedObject& placed = object(i);
  const scene::MeshGeometry& mesh = *placed.state->mesh;
  const geometry::DiscTree& discs = *mesh.discs;
  const Vec3 start = placed.T_object_device * from;
  const Vec3 along = placed.T_object_device.linear() * way;
  std::optional<JoinedFans> fans;
  if (mesh.fans) fans.emplace(placed, now_.time, start, start + along, reach, toolRadius_);
  const geometry::Mat3 turn = placed.T_object_device.linear().transpose();
  const double rounding = placed.metresPerUnit * discs.rounding();
  int groups = 0;
  const std::size_t count = discs.findNear(start, along, reach * kWiden * placed.stretch, places_, groups);
  work_ += kBoxVisit * groups;
  if (count > places_.size()) {
    cache_.invalidate();
    return false;
  }
  for (std::size_t k = 0; k < count && cache_.complete(); ++k) {
    const std::uint32_t place = places_[k];
    FacetCache::TriangleId id{discs.triangleAt(place), static_cast<std::int16_t>(i), 0};
    if (fans && !fans->join(id)) {
      ++work_;
      continue;
    }
    if (id.level > 0) {
      addToCache(id);
      continue;
    }
    const geometry::DiscTree::Disc disc = discs.discAt(place);
    work_ += kDiscVisit;
    cache_.add(id,
               {placed.T_device_object * disc.centre.cast<double>(),
                kWiden * placed.metresPerUnit * static_cast<double>(disc.radius),
                (turn * disc.normal.cast<double>()).normalized()},
               placed.skin, rounding);
  }
  joinedFans_ = joinedFans_ || (fans && fans->any());
  if (workSpent()) cache_.invalidate();
  return cache_.complete() || workSpent();
}

// Deforming facets of a point tool count at any distance: they may have come from farther away.
void ContactQuery::addToCache(const FacetCache::TriangleId& id) noexcept {
  const PlacedObject& placed = object(id.object);
  if (keepsFacets_) {
    work_ += kVisit;
    if (const Facet* const facet = facetOf(id)) cache_.add(*facet, placed.deformed);
    return;
  }
  const Ball ball = ballAround(id);
  // The boxes of tilted triangles reach farther than they do. Deforming ones may have come from there.
  if (!placed.deformed &&
      !ball.isWithin(cache_.reach() + placed.radius + 4 * placed.skin, cache_.nearestOfWay(ball.centre))) {
    work_ += kBoxVisit;
    return;
  }
  work_ += kBallVisit;
  cache_.add(id, ball.centre, ball.radius, placed.skin);
}

bool ContactQuery::hasDiscs(const PlacedObject& placed) const noexcept {
  return !keepsFacets_ && placed.state->mesh->discs && !placed.deformed && !isUneven(placed);
}

// Without discs, and beside fans, whose levels follow from the ball, as long as one fits.
bool ContactQuery::gathersBalls() const noexcept {
  if (keepsFacets_) return true;
  const bool ballsFit = fits_m_ > kSmallestGather_m;
  for (int i = 0; i < objectCount_; ++i) {
    if (!isPassable(i) && (!hasDiscs(object(i)) || (ballsFit && object(i).state->mesh->fans))) return true;
  }
  return false;
}

// Of the three corners, only their middle is placed on the device.
ContactQuery::Ball ContactQuery::ballAround(const FacetCache::TriangleId& id) const noexcept {
  const PlacedObject& placed = object(id.object);
  const scene::Corners k = placed.state->mesh->corners(verticesOf(id), now_.time);
  const Vec3 middle = (k.a + k.b + k.c) * (1.0 / 3);
  const double radius2 =
      std::max({(k.a - middle).squaredNorm(), (k.b - middle).squaredNorm(), (k.c - middle).squaredNorm()});
  return {placed.T_device_object * middle, kWiden * placed.metresPerUnit * std::sqrt(radius2)};
}

// A fast tick gathers too many for the slow ticks after it.
bool ContactQuery::isReusable(double radius) const noexcept {
  return cache_.size() <= kReuseLimit || cache_.extent() <= 2 * radius;
}

bool ContactQuery::ensureGathered(const Vec3& centre, double radius) noexcept {
  if (isReusable(std::max(radius, reserve_m_)) && cache_.covers(centre, radius)) return true;
  // A tool that leaves what was gathered in the same tick would soon leave a reserve, too. But where fans are
  // joined, it saves visits to their triangles.
  if ((!gatheredBefore_ || joinedFans_) && reserve_m_ > radius && gather(centre, reserve_m_)) return true;
  if (joinedFans_ && gather(centre, 2 * radius)) return true;
  return gather(centre, radius);
}

// A ball is near few of the triangles around the middle of its way.
bool ContactQuery::ensureWayGathered(const Vec3& from, const Vec3& way, double margin) noexcept {
  const double around = 0.5 * way.norm() + margin;
  if (isReusable(std::max(around, reserve_m_)) && cache_.covers(from, from + way)) return true;
  if (!gatheredBefore_ && reserve_m_ > kManyWays * around && gather(from + 0.5 * way, reserve_m_))
    return true;
  bool overflowed = false;
  gatherNear(from, way, margin, overflowed);
  if (cache_.complete() && cache_.size() < kFewAlongWay && passable_ == 0)
    fits_m_ = std::max(fits_m_, 2 * kSmallestGather_m);
  return cache_.complete();
}

void ContactQuery::gatherAround(const Vec3& centre, double radius) noexcept {
  bool fits = ensureGathered(centre, radius);
  for (double smaller = 0.25 * radius; !fits && smaller > kSmallestGather_m && !workSpent();
       smaller *= 0.25) {
    fits = gather(centre, smaller);
  }
}

void ContactQuery::gatherAhead(const Vec3& p, const Vec3& way, double margin) noexcept {
  const double length = way.norm();
  const double needed = kHalfWay * length + margin;
  if (!keepsFacets_) {
    if (!gathersBalls()) {
      double share = kWholeWay;
      while (!ensureWayGathered(p, share * way, share * (kAside * length + margin)) && !workSpent() &&
             share > kShortestWay) {
        share *= 0.5;
      }
      return;
    }
    // Around the middle: the triangles that it reaches grow with the radius more than with the way.
    const double around = kBallWay * length + margin;
    if (around > fits_m_ || !ensureGathered(p + 0.5 * way, around))
      gatherAround(p, std::min(needed, fits_m_));
    return;
  }
  if (isReusable(needed) && cache_.covers(p + 0.5 * way, needed)) return;
  // Where that would be too many facets: the beginning of the way.
  const double reach = std::min(2 * needed, roomyReach_m_);
  const double lead = reach > needed ? 1 : std::min(1.0, kHalfWay * reach / length);
  if (!gather(p + lead * way, reach)) gatherAround(p, reach);
}

bool ContactQuery::sameObjects() const noexcept {
  if (gatheredCount_ != objectCount_) return false;
  for (int i = 0; i < objectCount_; ++i) {
    if (gatheredFrom_[static_cast<std::size_t>(i)] != object(i).state) return false;
  }
  return true;
}

// Of a path that is examined up to its begin.
bool ContactQuery::endUnexamined(const Path& path, ObjectHit& hit) noexcept {
  hit = ObjectHit{};
  hit.stop = path.begin;
  hit.unexamined = true;
  return true;
}

bool ContactQuery::castTool(const Facet& f, const Path& path, double latest, CastHit& hit) const noexcept {
  ++facetCasts_;
  if (!pointTool_) return castBall(f, faces(), path.p, path.d, 1, latest, hit);
  Facet touched = f;
  touched.radius = radiusAt(f);
  return castBall(touched, faces(), path.p, path.d, 1, latest, hit);
}

const Facet* ContactQuery::gatheredFacet(int object, std::uint32_t triangle) const noexcept {
  if (keepsFacets_) {
    const Facet* const found = std::find_if(cache_.begin(), cache_.end(), [&](const Facet& f) {
      return f.object == object && f.triangle == triangle;
    });
    return found != cache_.end() ? found : nullptr;
  }
  for (int i = 0; i < cache_.size(); ++i) {
    const FacetCache::TriangleId& id = cache_.triangle(i);
    if (id.object == object && id.triangle == triangle) return facetOf(id);
  }
  return nullptr;
}

bool ContactQuery::castAtFacet(const Facet& f, const Vec3& p, const Vec3& g, ObjectHit& hit) const noexcept {
  const Vec3 d = g - p;
  const bool found = castTool(f, {p, d, 0, 1}, 1, hit);
  hit.object = f.object;
  hit.triangle = f.triangle;
  return found;
}

// A total order on hits, so that the first one does not depend on the order of visits.
void ContactQuery::considerFacet(const Facet& f, const Path& path, ObjectHit& best,
                                 bool& found) const noexcept {
  ObjectHit hit;
  const double latest = found ? best.stop : path.end;
  if (!castTool(f, path, latest, hit) || hit.stop > latest) return;
  hit.object = f.object;
  hit.triangle = f.triangle;
  const auto rank = [this](const ObjectHit& h) {
    return std::tuple(h.stop, -h.depth, h.object < 0 ? h.object : object(h.object).state->id, h.triangle);
  };
  if (found && !(rank(hit) < rank(best))) return;
  best = hit;
  found = true;
}

bool ContactQuery::castGathered(const Path& path, int only, ObjectHit& hit) noexcept {
  return keepsFacets_ ? castAtFacets(path, only, hit) : castAtTriangles(path, only, hit);
}

bool ContactQuery::castAtFacets(const Path& path, int only, ObjectHit& hit) noexcept {
  const Vec3 start = path.p + path.begin * path.d;
  cache_.moveTo(start);
  bool found = false;
  if (only < 0 && planes_ != nullptr) {
    for (const PlacedPlane& plane : *planes_) considerFacet(plane.facet, path, hit, found);
  }
  const auto consider = [&](const Facet& f) {
    if (only < 0 || f.object == only) considerFacet(f, path, hit, found);
  };
  const auto latest = [&] { return found ? hit.stop : path.end; };
  // The facet that blocked the last cast often blocks this one: then few others are near the path before it.
  const int first = lastBlocker_;
  if (first < cache_.size()) consider(cache_.begin()[first]);
  std::array<std::uint16_t, FacetCache::kMaxFacets> candidates;
  const int count = cache_.facetsNearPath(start, (latest() - path.begin) * path.d, candidates.data());
  const double length = path.d.norm();
  for (int k = 0; k < count; ++k) {
    const int i = candidates[static_cast<std::size_t>(k)];
    if (i == first) continue;
    if (workSpent()) return endUnexamined(path, hit);
    const Facet& f = cache_.begin()[i];
    const double before = latest();
    if (!cache_.isWithin(f.radius + 2 * f.skin + (before - path.begin) * length, i)) continue;
    consider(f);
    if (found && hit.stop < before) lastBlocker_ = i;
  }
  return found;
}

double ContactQuery::freeOfFaces(const Vec3& p, const Vec3& g, bool closesGaps) noexcept {
  std::array<std::uint16_t, FacetCache::kMaxFacets> candidates;
  const Vec3 d = g - p;
  // Another gather would cost more than a path that examines too many.
  if (!cache_.covers(p, d.norm()) && !ensureGathered(p, d.norm())) return 0;
  const int count = cache_.facetsNearPath(p, d, candidates.data());
  double free = 1;
  const auto meet = [&](Facet facet) {
    double stop = 1;
    if (closesGaps && castPoint(facet, faces(), p, d, facet.radius, stop)) free = std::min(free, stop);
    facet.radius = 0;
    CastHit hit;
    if (castBall(facet, faces(), p, d, 1, free, hit)) free = std::min(free, hit.stop);
  };
  facetCasts_ += count;
  for (int i = 0; i < count; ++i) meet(cache_.begin()[candidates[static_cast<std::size_t>(i)]]);
  if (planes_ == nullptr) return free;
  for (const PlacedPlane& plane : *planes_) meet(plane.facet);
  return free;
}

bool ContactQuery::castAtTriangles(const Path& path, int only, ObjectHit& hit) noexcept {
  cache_.moveTo(path.p + path.begin * path.d);
  ++cast_;
  bool found = false;
  if (only < 0 && planes_ != nullptr) {
    for (const PlacedPlane& plane : *planes_) considerFacet(plane.facet, path, hit, found);
  }
  const double touching = radius_ + 2 * cache_.maxSkin();
  const auto considerNear = [&](const Vec3& way) {
    if (workSpent()) return false;
    const auto near = cache_.trianglesNear(way, touching, discs());
    countScans();
    for (const int i : near) {
      if (workSpent()) return false;
      considerGathered(i, path, only, hit, found);
    }
    return true;
  };
  const auto way = [&] { return Vec3(((found ? hit.stop : path.end) - path.begin) * path.d); };
  // What blocked the last path, or is nearly touched, often blocks this one at once: then farther ones need
  // no exact test.
  constexpr double kAtOnce = 0.01;  // of the radius
  if (lastBlocker_ < cache_.size()) considerGathered(lastBlocker_, path, only, hit, found);
  if (way().norm() > kAtOnce * radius_ && !considerNear(Vec3::Zero())) return endUnexamined(path, hit);
  if (!considerNear(way())) return endUnexamined(path, hit);
  return found;
}

void ContactQuery::considerGathered(int i, const Path& path, int only, ObjectHit& best,
                                    bool& found) noexcept {
  if (std::exchange(considered_[static_cast<std::size_t>(i)], cast_) == cast_) return;
  const FacetCache::TriangleId& id = cache_.triangle(i);
  if (only >= 0 && id.object != only) return;
  const double touching = radius_ + 2 * cache_.maxSkin();
  const double latest = found ? best.stop : path.end;
  const Vec3 ahead = (latest - path.begin) * path.d;
  if (cache_.lowerBound(i, ahead) > touching) return;
  const Facet* const f = facetOf(id);
  if (f == nullptr) return cache_.exclude(i);
  if (cache_.refine(i, nearestPointOf(*f, path.p + path.begin * path.d), ahead) > touching) {
    work_ += kBoxVisit;
    return;
  }
  considerFacet(*f, path, best, found);
  if (found && best.stop < latest) lastBlocker_ = i;
}

// Where more triangles meet than can be gathered: examines them one after the other.
bool ContactQuery::castAtEach(const Path& path, int only, ObjectHit& hit) noexcept {
  bool found = false;
  if (only < 0 && planes_ != nullptr) {
    for (const PlacedPlane& plane : *planes_) considerFacet(plane.facet, path, hit, found);
  }
  const Vec3 middle = path.p + 0.5 * (path.begin + path.end) * path.d;
  const double reach = 0.5 * (path.end - path.begin) * path.d.norm();
  for (int i = 0; i < objectCount_; ++i) {
    if ((only >= 0 && i != only) || isPassable(i)) continue;
    const PlacedObject& placed = object(i);
    const double reach_m = reach + placed.radius + 4 * placed.skin;
    const Vec3 inObject = placed.T_object_device * middle;
    placed.state->mesh->index.visitNear(
        inObject, reach_m * kWiden * placed.stretch, [&](std::uint32_t triangle) noexcept -> bool {
          if (workSpent()) return false;
          if (!mayReach(placed, triangle, inObject, reach_m)) return true;
          const FacetCache::TriangleId id{triangle, static_cast<std::int16_t>(i), 0};
          if (!keepsFacets_ && !ballAround(id).isWithin(reach_m, middle)) {
            work_ += kBoxVisit;
            return true;
          }
          const Facet* const f = facetOf(id);
          if (f == nullptr) {
            work_ += kVisit;
          } else {
            considerFacet(*f, path, hit, found);
          }
          return true;
        });
  }
  return workSpent() ? endUnexamined(path, hit) : found;
}

// The index has no query for a swept ball: gathers along the path from `begin` to `end`, in steps that grow
// while the path is free and shrink when the storage overflows.
bool ContactQuery::castInSteps(const Vec3& p, const Vec3& d, double begin, double end, int only,
                               ObjectHit& hit) noexcept {
  const double length = d.norm();
  const double smallestStep = std::min(1.0 / 64, 2 * (gathersBalls() ? fits_m_ : kSmallestWay_m) / length);
  double step = keepsFacets_ ? 1.0 : std::min(1.0, std::max(0.125 * radius_ / length, smallestStep));
  while (begin < end) {
    const bool byWay = !gathersBalls();
    const double longest_m =
        byWay ? longestStep_m_ : std::min({longestStep_m_, 2 * roomyReach_m_, 2 * fits_m_});
    step = std::min({step, end - begin, std::max(longest_m / length, smallestStep)});
    const bool fits =
        byWay ? ensureWayGathered(p + begin * d, step * d,
                                  kAside * step * length + std::min(kSmallestGather_m, longestStep_m_))
              : ensureGathered(p + (begin + 0.5 * step) * d, 0.5 * step * length * kWiden);
    if (!fits && step > smallestStep && !workSpent()) {
      step *= 0.25;
      longestStep_m_ = step * length;
      continue;
    }
    const Path path{p, d, begin, begin + step};
    if (fits ? castGathered(path, only, hit) : castAtEach(path, only, hit)) return true;
    begin += step;
    step *= 2;
  }
  return false;
}

bool ContactQuery::castUpTo(double share, const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept {
  const Vec3 d = g - p;
  double free = 0;
  if (cache_.covers(p, 0)) {
    free = std::min(share, cache_.exitOf(p, d));
    if (castGathered({p, d, 0, free}, -1, hit)) return true;
    if (free == share) return false;
  }
  return castInSteps(p, d, free, share, -1, hit);
}

bool ContactQuery::castPast(std::uint64_t passable, const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept {
  // What it passes may have more triangles on its way than there is room for.
  cache_.invalidate();
  passable_ = passable;
  const bool found = cast(p, g, hit);
  passable_ = 0;
  cache_.invalidate();
  return found;
}

bool ContactQuery::castWithinGathered(const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept {
  if (!isGathered(p)) return cast(p, g, hit);
  const Vec3 d = g - p;
  return castGathered({p, d, 0, cache_.exitOf(p, d)}, -1, hit);
}

bool ContactQuery::castAtObject(int object, const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept {
  return castInSteps(p, g - p, 0, 1, object, hit);
}

}  // namespace hapticd::realtime

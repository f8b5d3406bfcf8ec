// Gathering: which triangles near the tool are kept, how many fit, and what is gathered again.
#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "geometry/disc_tree.h"
#include "geometry/fans.h"
#include "realtime/render/contact_query.h"
#include "scene/mesh_geometry.h"

namespace hapticd::realtime {
namespace {

// By how much joined triangles may be off (see geometry/fans.h), and more by a share of the tool radius: far
// less than the gap tolerance, and than anybody feels.
constexpr double kFanError_m = 1e-7;
constexpr double kFanErrorShare = 5e-4;
constexpr double kHalfWay = 0.6;   // half of the way of a tick, and what it bends aside
constexpr double kBallWay = 0.7;   // the same for a ball, whose last steps may lead beyond its rest
constexpr double kWholeWay = 1.1;  // of a tick, and a little more
constexpr double kShortestWay = 0.01;
constexpr int kFewAlongWay = 64;  // triangles: then a ball of the same margin fits, too
constexpr double kManyWays = 4;   // a reserve for fewer is no less work than to gather each
constexpr int kReuseLimit = 32;   // reuse the cached facets up to this count instead of querying again

}  // namespace

void ContactQuery::forget() noexcept {
  cache_.forget();
  ++generation_;
  unfitCount_ = 0;
  joinedFans_ = false;
  roomyReach_m_ = fits_m_ = std::numeric_limits<double>::infinity();
  reserve_m_ = keepsFacets_ ? 0 : kReserveShare * toolRadius_;
  countBefore_ = fullReserves_ = 0;
}

void ContactQuery::dropStaleFacets() noexcept {
  overlappedTriangleCount_ = 0;  // the objects may have other indices
  if (gatheredGeneration_ == generation_ && sameObjects()) return;
  cache_.invalidate();
  unfitCount_ = 0;
}

bool ContactQuery::sameObjects() const noexcept {
  if (gatheredCount_ != objectCount_) return false;
  for (int i = 0; i < objectCount_; ++i) {
    if (gatheredFrom_[static_cast<std::size_t>(i)] != object(i).state) return false;
  }
  return true;
}

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

// Of the three corners, only their middle is placed on the device.
ContactQuery::Ball ContactQuery::ballAround(const FacetCache::TriangleId& id) const noexcept {
  const PlacedObject& placed = object(id.object);
  const scene::Corners k = placed.state->mesh->corners(verticesOf(id), now_.time);
  const Vec3 middle = (k.a + k.b + k.c) * (1.0 / 3);
  const double radius2 =
      std::max({(k.a - middle).squaredNorm(), (k.b - middle).squaredNorm(), (k.c - middle).squaredNorm()});
  return {placed.T_device_object * middle, kWiden * placed.metresPerUnit * std::sqrt(radius2)};
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
    while (fits_m_ > kSmallestGather_m && !workSpent() && !discsFit(centre, fits_m_))
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
    all += findDiscs(*placed.state->mesh->discs, placed.T_object_device * centre, Vec3::Zero(),
                     (radius + placed.radius) * placed.stretch);
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
  placed.index(now_.time).visitNear(
      inObject, around * kWiden * placed.stretch, [&](std::uint32_t triangle) noexcept {
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

// Into places_. What would spend the work of the tick does not fit.
std::size_t ContactQuery::findDiscs(const geometry::DiscTree& discs, const Vec3& from, const Vec3& way,
                                    double distance) noexcept {
  const int most = std::max(kVisit * (kMaxVisits - facetCasts_) - work_, 0) / kGroupVisit + 1;
  int groups = 0;
  const std::size_t count = discs.findNear(from, way, distance, most, places_, groups);
  work_ += kGroupVisit * groups;
  return count;
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
  const std::size_t count = findDiscs(discs, start, along, reach * kWiden * placed.stretch);
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
      ensureGathered(p, std::min(needed, fits_m_));
    return;
  }
  if (isReusable(needed) && cache_.covers(p + 0.5 * way, needed)) return;
  // Where that would be too many facets: the beginning of the way.
  const double reach = std::min(2 * needed, roomyReach_m_);
  const double lead = reach > needed ? 1 : std::min(1.0, kHalfWay * reach / length);
  if (!gather(p + lead * way, reach)) ensureGathered(p, reach);
}

}  // namespace hapticd::realtime

// Casts of the tool against the gathered facets, or in steps where they do not reach.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>

#include "realtime/render/contact_query.h"

namespace hapticd::realtime {
namespace {

constexpr double kSmallestWay_m = 1e-6;

}  // namespace

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

// The gathered facets that a point tool overlaps at p, in front of them: it came through one-sided faces from
// behind, and has not risen by its radius yet. Once for each cast.
std::span<const std::uint16_t> ContactQuery::overlappedAt(const Vec3& p) const noexcept {
  if (overlappedCount_ < 0) {
    const auto begin = overlapped_.begin();
    const int near = cache_.facetsNearPath(p, Vec3::Zero(), overlapped_.data());
    const auto end = std::remove_if(begin, begin + near, [&](std::uint16_t i) {
      const Facet& f = cache_.begin()[i];
      const double overlap = radiusAt(f) - 4 * f.skin;
      return !isTouchable(f, faces(), p) || (nearestPointOf(f, p) - p).squaredNorm() >= overlap * overlap;
    });
    overlappedCount_ = static_cast<int>(end - begin);
  }
  return {overlapped_.data(), static_cast<std::size_t>(overlappedCount_)};
}

// Where a face that the tool overlaps goes on in another one, their common edge is no obstacle to a tool in
// front of both: the other face holds it no higher than it is, and not at all where its way does not lead
// into that. Then false.
bool ContactQuery::meetsBeside(const Facet& f, const Path& path, ObjectHit& hit) const noexcept {
  if (!hit.atEdge || faces() == scene::TouchableFaces::both) return true;
  const Vec3 up = faces() == scene::TouchableFaces::back ? Vec3(-f.normal) : f.normal;
  const double height = up.dot(path.p + hit.stop * path.d - f.a);
  const auto goesOn = [&](std::uint16_t i) {
    const Facet& g = cache_.begin()[i];
    const Vec3& edge = hit.halfSpace.anchor;
    return &g != &f && (nearestPointOf(g, edge) - edge).squaredNorm() <= g.skin * g.skin;
  };
  const auto overlapped = overlappedAt(path.p);
  if (height < 0 || std::none_of(overlapped.begin(), overlapped.end(), goesOn)) return true;
  constexpr double kRise = 0.25;  // of the skin: see Proxy::acceptOverlaps()
  hit.depth = -up.dot(path.d);
  hit.halfSpace = {up, f.a, std::min(hit.halfSpace.standoff, height + kRise * f.skin)};
  hit.atEdge = false;
  return hit.depth > 0;
}

// A total order on hits, so that the first one does not depend on the order of visits.
void ContactQuery::considerFacet(const Facet& f, const Path& path, ObjectHit& best, bool& found,
                                 bool gathered) const noexcept {
  ObjectHit hit;
  const double latest = found ? best.stop : path.end;
  const bool overlapped = cameFromBehind_ && isOverlapped(f, path.p);
  if (overlapped) {
    if (!castGrowing(f, path, latest, hit)) return;
  } else {
    if (!castTool(f, path, latest, hit) || hit.stop > latest) return;
    if (gathered && !meetsBeside(f, path, hit)) return;
  }
  hit.object = f.object;
  hit.triangle = f.triangle;
  const auto isFirst = [&] {
    const auto rank = [this](const ObjectHit& h) {
      return std::tuple(h.stop, -h.depth, h.object < 0 ? h.object : object(h.object).state->id, h.triangle);
    };
    return !found || rank(hit) < rank(best);
  };
  if (!isFirst()) return;
  if (cameFromBehind_ && !overlapped && (!meetsGoingOn(f, path, latest, hit) || !isFirst())) return;
  best = hit;
  found = true;
}

bool ContactQuery::castGathered(const Path& path, int only, ObjectHit& hit) noexcept {
  return keepsFacets_ ? castAtFacets(path, only, hit) : castAtTriangles(path, only, hit);
}

bool ContactQuery::castAtFacets(const Path& path, int only, ObjectHit& hit) noexcept {
  const Vec3 start = path.p + path.begin * path.d;
  cache_.moveTo(start);
  overlappedCount_ = -1;
  bool found = false;
  if (only < 0 && planes_ != nullptr) {
    for (const PlacedPlane& plane : *planes_) considerFacet(plane.facet, path, hit, found);
  }
  const auto consider = [&](const Facet& f) {
    if (only < 0 || f.object == only) considerFacet(f, path, hit, found, true);
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

// Whether a ball at p came through a one-sided face from behind and is not out of it yet. What moves pushes a
// ball out that it gets into; so does a fan whose triangles are joined in another way than before.
bool ContactQuery::isOverlapped(const Facet& f, const Vec3& p, double distance2) const noexcept {
  constexpr double kSlight = 1e-3;  // of the radius: twice what joining may move a face
  const double overlap = (1 - kSlight) * f.radius;
  return f.object >= 0 && distance2 < overlap * overlap && object(f.object).rests() &&
         isTouchable(f, faces(), p);
}

bool ContactQuery::isOverlapped(const Facet& f, const Vec3& p) const noexcept {
  return isOverlapped(f, p, (nearestPointOf(f, p) - p).squaredNorm());
}

// For the faces that it overlaps, a ball that came from behind is as large as fits before the nearest of
// them: it grows as it comes out, and its centre gets no nearer. What it rises from does not hold it at all.
bool ContactQuery::castGrowing(Facet f, const Path& path, double latest, ObjectHit& hit) const noexcept {
  const double rise = f.normal.dot(path.d);
  if (faces() == scene::TouchableFaces::back ? rise <= 0 : rise >= 0) return false;
  f.radius = std::max(0.0, std::sqrt(nearestOverlapped2_) - f.skin);
  ++facetCasts_;
  return castBall(f, faces(), path.p, path.d, 1, latest, hit) && hit.stop <= latest;
}

// The same for a face that it meets where an overlapped one goes on in it. False when that does not hold it.
bool ContactQuery::meetsGoingOn(Facet f, const Path& path, double latest, ObjectHit& hit) const noexcept {
  constexpr double kGap2 = kGapTolerance_m * kGapTolerance_m;
  if (!hit.atEdge || f.object < 0 || !object(f.object).rests()) return true;
  const Vec3 edge = hit.halfSpace.anchor;
  for (int i = 0; i < overlappedTriangleCount_; ++i) {
    const Facet* const g = facetOf(overlappedTriangles_[static_cast<std::size_t>(i)]);
    ++work_;
    if (g == nullptr || std::abs(g->normal.dot(edge - g->a)) > kGapTolerance_m) continue;
    work_ += kBoxVisit;
    if ((nearestPointOf(*g, edge) - edge).squaredNorm() <= kGap2) return castGrowing(f, path, latest, hit);
  }
  return true;
}

// What a ball overlaps is found by the first cast from a place, as if it overlapped nothing.
bool ContactQuery::castAtTriangles(const Path& path, int only, ObjectHit& hit) noexcept {
  const bool known = overlappedTriangleCount_ > 0 && overlappedFrom_ == path.p && overlappedOnly_ == only;
  if (!known) {
    overlappedTriangleCount_ = 0;
    overlappedFrom_ = path.p;
    overlappedOnly_ = only;
    const bool found = castAtNear(path, only, hit);
    if (hit.unexamined || overlappedTriangleCount_ == 0) return found;
    hit = {};
  }
  cameFromBehind_ = true;
  const bool found = castAtNear(path, only, hit);
  cameFromBehind_ = false;
  return found;
}

bool ContactQuery::castAtNear(const Path& path, int only, ObjectHit& hit) noexcept {
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
  if (way().norm() > kAtOnce * radius_) {
    if (!considerNear(Vec3::Zero())) return endUnexamined(path, hit);
    if (!cameFromBehind_ && overlappedTriangleCount_ > 0) return found;
  }
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
  const Vec3 start = path.p + path.begin * path.d;
  const Vec3 foot = nearestPointOf(*f, start);
  if (cache_.refine(i, foot, ahead) > touching) {
    work_ += kBoxVisit;
    return;
  }
  if (!cameFromBehind_ && noteOverlap(*f, id, path, (foot - start).squaredNorm())) {
    work_ += kBoxVisit;
    return;
  }
  considerFacet(*f, path, best, found);
  if (found && best.stop < latest) lastBlocker_ = i;
}

// Whether the ball overlaps this face or another: then this cast is not the one that counts.
bool ContactQuery::noteOverlap(const Facet& f, const FacetCache::TriangleId& id, const Path& path,
                               double distance2) noexcept {
  if (path.begin > 0 || pointTool_ || faces() == scene::TouchableFaces::both) return false;
  const bool first = overlappedTriangleCount_ == 0;
  if (!isOverlapped(f, path.p, distance2)) return !first;
  nearestOverlapped2_ = first ? distance2 : std::min(nearestOverlapped2_, distance2);
  overlappedTriangles_[static_cast<std::size_t>(overlappedTriangleCount_++)] = id;
  return true;
}

// Where more triangles meet than can be gathered: examines them one after the other.
bool ContactQuery::castAtEach(const Path& path, int only, ObjectHit& hit) noexcept {
  overlappedTriangleCount_ = 0;
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
    placed.index(now_.time).visitNear(
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
  overlappedTriangleCount_ = 0;
  passable_ = passable;
  const bool found = cast(p, g, hit);
  passable_ = 0;
  overlappedTriangleCount_ = 0;
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

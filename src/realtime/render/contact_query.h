// Broad and narrow phase of one tick: objects near the HIP, facets around the proxy, and casts against them.
//
// A tick costs about one traversal of the index: the facets around the proxy are gathered once, and the casts
// of the move run over that array; only a path that leaves the gathered ball traverses the index again. The
// indices propose candidates. Every decision is made here, in double precision and in the device frame, and
// does not depend on the order of candidates.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "base/time.h"
#include "geometry/gap_tolerance.h"
#include "realtime/render/facet_cache.h"
#include "realtime/render/object_distances.h"
#include "realtime/render/placed_planes.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using base::Nanos;
using geometry::Affine;

/// Parts of an object this near to the tool decide whether its move is a jump.
inline constexpr double kNear_m = 0.050;
/// Triangles that a tick examines; of a ball also what takes a part of that time. A count and not a time, so
/// that the clock never changes a force.
inline constexpr int kMaxVisits = 8192;
using geometry::kGapTolerance_m;
using geometry::kLargestGapTolerance_m;

/// An object in this tick and, if it existed, in the previous one.
struct PlacedObject {
  const scene::ObjectState* state = nullptr;
  Affine T_device_object = Affine::Identity();
  Affine T_object_device = Affine::Identity();
  double stretch = 1;        ///< largest number of object units per metre, over all directions
  double metresPerUnit = 1;  ///< largest, over all directions
  /// Largest number of object units per metre along each axis of the object.
  Vec3 stretchAlong = Vec3::Ones();
  double skin = 0;                   ///< see facet.h
  double radius = 0;                 ///< of the ball that touches it; see kGapTolerance_m
  bool atRest = false;               ///< neither moves nor deforms any more in this scene
  std::uint64_t restGeneration = 0;  ///< generation in which it was found at rest
  bool mirrored = false;             ///< the placement contains a reflection, which reverses the winding
  // Compared with the previous tick:
  /// Null when there is nothing to compare with: it did not exist, or was not felt because it appeared around
  /// the tool or beyond the room for near objects. Its way from there passes over nothing.
  const scene::ObjectState* before = nullptr;
  Affine T_device_objectBefore = Affine::Identity();
  bool moved = false;     ///< the placement changed
  bool deformed = false;  ///< vertices changed under the same triangles
  bool jumped = false;    ///< placement or triangles changed without interpolation

  /// Corners in device metres.
  scene::Corners corners(std::uint32_t triangle, Nanos now) const noexcept;
  /// The same for a triangle between any three vertices.
  scene::Corners corners(const geometry::Triangle& triangle, Nanos now) const noexcept;
  scene::Corners cornersBefore(std::uint32_t triangle, Nanos then) const noexcept;
  /// Its triangles; while it deforms, around their whole way.
  const scene::SpatialIndex& index(Nanos now) const noexcept {
    return deformed ? state->mesh->index : state->mesh->indexAt(now);
  }
  /// Whether it is where and as it was in the previous tick.
  bool rests() const noexcept { return before != nullptr && !moved && !deformed && !jumped; }
  /// Whether its faces may have passed over the proxy by deforming.
  bool sweptByDeforming() const noexcept { return deformed && !jumped && before != nullptr; }
  /// The present position of a point that was fixed to the object in the previous tick.
  Vec3 carried(const Vec3& p) const noexcept;
};

/// What ends a path: the first facet that blocks it, or the place up to which it was examined.
struct ObjectHit : CastHit {
  bool unexamined = false;  ///< the work of this tick is spent: nothing is known of the path beyond `stop`
  int object = 0;           ///< index of the near object; -1 - index for a plane of the scene
  std::uint32_t triangle = 0;
};

/// A scene at the time of one tick. The snapshot must outlive the next tick, which compares with it.
struct SceneAtTime {
  const scene::SceneSnapshot* scene = nullptr;
  Nanos time = 0;
};

/// Servo thread: noexcept, fixed storage, no allocation. Object indices are valid until the next beginTick().
class ContactQuery {
 public:
  explicit ContactQuery(double toolRadius_m) noexcept
      : toolRadius_(std::max(toolRadius_m, 0.5 * kGapTolerance_m)),
        keepsFacets_(toolRadius_m <= kLargestGapTolerance_m),
        cache_(toolRadius_),
        reserve_m_(keepsFacets_ ? 0 : kReserveShare * toolRadius_) {}

  /// Before a tick that does not follow the previous one: drops all that was kept from its scene.
  void restart() noexcept {
    ++generation_;
    allAppeared_ = true;
    enclosingCount_ = 0;
    enclosureRests_ = 0;
    crowd_ = 0;
    distances_.restart();
  }
  /// Drops what earlier ticks learnt to save work. With it, the levels of fans may differ, and where the work
  /// of a tick ends.
  void forget() noexcept;
  /// The tool has left all that appeared around it.
  void leaveAll() noexcept { enclosingCount_ = 0; }
  /// Starts a tick without objects, with the tool where the tick before left it. `planes` take part in every
  /// cast and must live until the next beginTick().
  void beginTick(const SceneAtTime& now, const SceneAtTime& before, const Vec3& tool,
                 const PlacedPlanes* planes = nullptr) noexcept;
  /// Adds the objects within `reach` of `centre`; drops gathered facets that are out of date.
  void addObjectsNear(const Vec3& centre, double reach, const Vec3& tool) noexcept;
  /// Leaves out those that appeared around `tool` and that it has not left since.
  void leaveOutEnclosing(const Vec3& tool) noexcept;
  /// The same for this object, whose index the ones after it take.
  void leaveOut(int object) noexcept;
  /// True when this object is left out.
  bool isLeftOut(std::int32_t id) const noexcept {
    return std::find(enclosing_.begin(), enclosing_.begin() + enclosingCount_, id) !=
           enclosing_.begin() + enclosingCount_;
  }
  /// True when it left out others than the one before.
  bool leftOutChanged() const noexcept { return leftOutChanged_; }
  /// Adds one object by its id and returns its index; -1 when the scene does not contain it.
  int addObject(std::int32_t id) noexcept;

  int objectCount() const noexcept { return objectCount_; }
  /// Whether no near object moved or deformed since the previous tick.
  bool allAtRest() const noexcept {
    return std::none_of(objects_.begin(), objects_.begin() + objectCount_,
                        [](const PlacedObject& o) { return o.moved || o.deformed || o.jumped; });
  }
  const PlacedObject& object(int i) const noexcept { return objects_[static_cast<std::size_t>(i)]; }

  /// Ends a path from p to g where objects that were left out begin; true when it did.
  bool shorten(const Vec3& p, Vec3& g) const noexcept;
  /// Objects were left out: shorten() may end a path.
  bool limitsTravel() const noexcept { return std::isfinite(freeTravel_); }
  /// True when an object is left out because it appeared around the tool.
  bool isEnclosed() const noexcept { return enclosingCount_ > 0; }
  /// How many triangles this tick looked at to find those out.
  int enclosureVisits() const noexcept { return enclosureVisits_; }

  /// Gathers the facets that a tool inside a ball can touch, so that casts inside it need no index. False
  /// when they exceed the storage; casts then use the index.
  bool gather(const Vec3& centre, double radius) noexcept;
  /// As gather(), but reuses facets gathered before, also in an earlier tick, if they cover the ball. A ball
  /// tool gathers a reserve for that.
  bool ensureGathered(const Vec3& centre, double radius) noexcept;
  /// Gathers what the tool may meet on its way from p to p + way in this tick, with a margin to all sides. A
  /// point tool gathers the same way once more, for the next tick; a ball has its reserve.
  void gatherAhead(const Vec3& p, const Vec3& way, double margin) noexcept;
  /// Whether it gathers what is around the middle of a way, and not what is along it.
  bool gathersBalls() const noexcept;
  /// Radius in which there are some dozens of facets, where the last ones were gathered. For a ball tool: its
  /// reserve.
  double roomyReach() const noexcept { return keepsFacets_ ? roomyReach_m_ : reserve_m_; }
  bool isGathered(const Vec3& p) const noexcept { return cache_.isInside(p); }
  /// Calls visit(facet) for every gathered facet within `distance` of p and possibly for others. The
  /// reference is valid until the next visit.
  template <class Visit>
  void forEachGathered(const Vec3& p, double distance, Visit&& visit) noexcept;

  /// The first obstacle on the path from p to g, or the end of what was examined; false when the path is
  /// free.
  bool cast(const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept { return castUpTo(1, p, g, hit); }
  /// The same for the first `share` of the path.
  bool castUpTo(double share, const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept;
  /// The same for the start of the path only: as far as the gathered facets reach.
  bool castWithinGathered(const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept;
  /// As cast(), through the objects whose bits are set in `passable`.
  bool castPast(std::uint64_t passable, const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept;
  /// The same against one object only.
  bool castAtObject(int object, const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept;

  /// The share of the path from p to g on which a point, rather than a ball, meets no face. For a point tool.
  /// With `closesGaps` it passes none that the ball does not pass.
  double freeOfFaces(const Vec3& p, const Vec3& g, bool closesGaps = false) noexcept;
  /// From now on, casts move a point tool instead of the tool: with a ball, its centre.
  void castPointTool(bool point) noexcept {
    pointTool_ = point;
    overlappedTriangleCount_ = 0;
  }
  /// Of the ball that casts move against a facet.
  double radiusAt(const Facet& f) const noexcept {
    return pointTool_ ? std::min(f.radius, 0.5 * kGapTolerance_m) : f.radius;
  }
  /// The gathered facet of a hit; null when it is not gathered. Valid until the next visit or cast.
  const Facet* gatheredFacet(int object, std::uint32_t triangle) const noexcept;
  /// Casts the tool against one facet.
  bool castAtFacet(const Facet& f, const Vec3& p, const Vec3& g, ObjectHit& hit) const noexcept;

  /// Smallest skin of the near objects. Lengths below a fraction of it are rounding.
  double minSkin() const noexcept { return minSkin_; }
  /// Largest skin of the gathered facets.
  double maxSkin() const noexcept { return cache_.maxSkin(); }
  /// Largest radius of the ball that touches the near objects: the tool's, or half the gap tolerance.
  double radius() const noexcept { return radius_; }
  scene::TouchableFaces faces() const noexcept { return now_.scene->faces; }
  /// True when objects or facets had to be left out in this tick.
  bool overflowed() const noexcept { return overflowed_; }
  /// How often the tool was cast against one facet in this tick.
  int facetCasts() const noexcept { return facetCasts_; }
  /// How many triangles this tick examined: looked at in a gather, or cast at.
  int visits() const noexcept { return facetCasts_ + work_ / kVisit; }
  /// True when these are kMaxVisits. Casts then examine nothing more.
  bool workSpent() const noexcept { return visits() >= kMaxVisits; }
  /// Counts what the caller examined itself: `tests` that take a quarter of a visit each.
  void countTests(int tests) noexcept { work_ += tests * kBoxVisit; }

 private:
  static constexpr int kMaxObjects = 64;
  static constexpr int kMemoBits = 10;
  // What a tick examines, in sixteenths of a cast at one facet.
  static constexpr int kVisit = 16;      // a triangle of a point tool
  static constexpr int kBallVisit = 6;   // one that a ball gathers by the index
  static constexpr int kDiscVisit = 2;   // one that it gathers by its disc; a disc that is made
  static constexpr int kFacetVisit = 4;  // a facet that a ball makes
  static constexpr int kBoxVisit = 4;    // one that its box or its distance rules out
  static constexpr int kGroupVisit = 8;  // eight discs or boxes that are tested in a tree
  static constexpr int kScansOfOne = 6;  // discs that a cast looks at, for a sixteenth
  static constexpr int kMaxUnfit = 8;
  static constexpr double kReserveShare = 0.2;  // of the tool radius, that is gathered in reserve at most
  static constexpr double kWiden = 1 + 1e-6;    // covers the rounding of queries that change frames
  static constexpr double kSmallestGather_m = 10e-6;
  static constexpr double kAside = 0.05;  // of a way that is gathered: how far a ball may leave it

  class JoinedFans;

  struct Ball {
    Vec3 centre;
    double radius;
    bool isWithin(double distance, const Vec3& p) const noexcept {
      return (centre - p).squaredNorm() <= (distance + radius) * (distance + radius);
    }
  };

  // The result of makeFacet(); generation 0: not valid in the next tick.
  struct MemoFacet {
    std::uint64_t generation = 0;
    const scene::ObjectState* state = nullptr;
    int level = 0;
    Facet facet;
  };

  // The part [begin, end] of the path p + t d, t in [0, 1]. A hit is computed on the whole path, so that it
  // does not depend on the parts.
  struct Path {
    const Vec3& p;
    const Vec3& d;
    double begin;
    double end;
  };

  void addObjectsByIndex(const scene::SceneSnapshot& scene, const Vec3& centre, double reach,
                         const Vec3& tool) noexcept;
  void addNearestObjects(const scene::SceneSnapshot& scene, double reach, const Vec3& tool) noexcept;
  void add(const scene::ObjectState& state, const Ball* here = nullptr) noexcept;
  bool isNear(const PlacedObject& placed, const Ball& ball) const noexcept;
  bool wasNear(const PlacedObject& placed, const Ball& ball) const noexcept;
  void findEnclosing(const Vec3& tool) noexcept;
  void dropStaleFacets() noexcept;
  bool place(const scene::ObjectState& state, PlacedObject& placed) const noexcept;
  bool sameObjects() const noexcept;
  bool isReusable(double radius) const noexcept;
  bool isPassable(int object) const noexcept {
    return (passable_ >> static_cast<unsigned>(object) & 1U) != 0;
  }
  void estimateRoom(double radius) noexcept;
  void learnWhatFits(const Vec3& centre, double radius, bool overflowed) noexcept;
  bool discsFit(const Vec3& centre, double radius) noexcept;
  bool canGatherFansAlongWays() const noexcept;
  void adaptReserve() noexcept;
  bool isUnfit(const Vec3& centre, double radius) const noexcept;
  void compareWithBefore(PlacedObject& placed) const noexcept;
  bool viewJumped(const PlacedObject& placed) const noexcept;
  bool mayReach(const PlacedObject& object, std::uint32_t triangle, const Vec3& inObject,
                double reach_m) noexcept;
  geometry::Triangle verticesOf(const FacetCache::TriangleId& id) const noexcept;
  scene::Corners cornersOf(const FacetCache::TriangleId& id) const noexcept;
  const Facet* facetOf(const FacetCache::TriangleId& id) const noexcept;
  Ball ballAround(const FacetCache::TriangleId& id) const noexcept;
  void gatherNear(const Vec3& from, const Vec3& way, double radius, bool& overflowed) noexcept;
  void gatherByIndex(int object, const Vec3& from, const Vec3& way, double reach) noexcept;
  std::size_t findDiscs(const geometry::DiscTree& discs, const Vec3& from, const Vec3& way,
                        double distance) noexcept;
  bool gatherByDiscs(int object, const Vec3& from, const Vec3& way, double reach) noexcept;
  bool ensureWayGathered(const Vec3& from, const Vec3& way, double margin) noexcept;
  static bool isUneven(const PlacedObject& placed) noexcept;
  bool hasDiscs(const PlacedObject& placed) const noexcept;
  void addToCache(const FacetCache::TriangleId& id) noexcept;
  auto discs() const noexcept {
    return [this](const FacetCache::TriangleId& id) {
      work_ += kDiscVisit;
      return discAround(cornersOf(id));
    };
  }
  void countScans() noexcept { work_ += cache_.takeScans() / kScansOfOne; }
  static bool endUnexamined(const Path& path, ObjectHit& hit) noexcept;
  bool castTool(const Facet& f, const Path& path, double latest, CastHit& hit) const noexcept;
  std::span<const std::uint16_t> overlappedAt(const Vec3& p) const noexcept;
  bool meetsBeside(const Facet& f, const Path& path, ObjectHit& hit) const noexcept;
  void considerFacet(const Facet& f, const Path& path, ObjectHit& best, bool& found,
                     bool gathered = false) const noexcept;
  bool castGathered(const Path& path, int only, ObjectHit& hit) noexcept;
  bool castAtFacets(const Path& path, int only, ObjectHit& hit) noexcept;
  bool castAtTriangles(const Path& path, int only, ObjectHit& hit) noexcept;
  bool castAtNear(const Path& path, int only, ObjectHit& hit) noexcept;
  bool isOverlapped(const Facet& f, const Vec3& p, double distance2) const noexcept;
  bool isOverlapped(const Facet& f, const Vec3& p) const noexcept;
  bool noteOverlap(const Facet& f, const FacetCache::TriangleId& id, const Path& path,
                   double distance2) noexcept;
  bool castGrowing(Facet f, const Path& path, double latest, ObjectHit& hit) const noexcept;
  bool meetsGoingOn(Facet f, const Path& path, double latest, ObjectHit& hit) const noexcept;
  void considerGathered(int i, const Path& path, int only, ObjectHit& best, bool& found) noexcept;
  bool castAtEach(const Path& path, int only, ObjectHit& hit) noexcept;
  bool castInSteps(const Vec3& p, const Vec3& d, double begin, double end, int only, ObjectHit& hit) noexcept;

  double toolRadius_;
  bool keepsFacets_;  // see facet_cache.h
  double radius_ = toolRadius_;
  SceneAtTime now_;
  SceneAtTime before_;
  const PlacedPlanes* planes_ = nullptr;
  bool sameWorkspace_ = true;
  Vec3 tool_ = Vec3::Zero();
  std::array<PlacedObject, kMaxObjects> objects_;
  int objectCount_ = 0;
  // Ids of the objects that appeared around the tool.
  std::array<std::int32_t, kMaxObjects> enclosing_{};
  int enclosingCount_ = 0;
  bool leftOutChanged_ = false;
  int enclosureVisits_ = 0;  // in this tick
  int enclosureRests_ = 0;   // ticks until it is tested again whether the tool has left them
  bool allAppeared_ = true;  // in this tick
  std::size_t crowd_ = 0;    // number of objects in a scene with more boxes around the tool than fit, or 0
  ObjectDistances distances_;
  // The tool may move this far from there: beyond, there are objects that did not fit.
  double freeTravel_ = 0;
  Vec3 freeFrom_ = Vec3::Zero();
  double minSkin_ = 0;
  int skinCount_ = 0;  // objects that count for it
  FacetCache cache_;
  bool joinedFans_ = false;  // in the last gather()
  // The last balls whose triangles did not fit, and the steps of casts of this tick that shrank for that.
  std::array<Ball, kMaxUnfit> unfit_;
  int unfitCount_ = 0;
  double longestStep_m_ = 0;
  double roomyReach_m_ = std::numeric_limits<double>::infinity();
  bool gatheredBefore_ = false;  // in this tick
  double reserve_m_ = 0;         // of a ball tool: what is near is gathered at least within this
  int countBefore_ = 0;          // of the triangles in the last reserve
  int fullReserves_ = 0;         // how many are still gathered before a smaller one is tried
  double fits_m_ = std::numeric_limits<double>::infinity();  // what was not too much, of a ball tool
  int lastBlocker_ = 0;     // the gathered facet that blocked the last cast of a ball
  std::uint64_t cast_ = 0;  // of a ball: its number, and the last one that considered each gathered facet
  std::array<std::uint64_t, FacetCache::kMaxTriangles> considered_{};
  // Generation and objects of the last gather(); 0: not reusable in another tick.
  std::uint64_t gatheredGeneration_ = 0;
  int gatheredCount_ = 0;
  std::array<const scene::ObjectState*, kMaxObjects> gatheredFrom_{};
  std::uint64_t generation_ = 1;  // of all that is kept from tick to tick
  mutable std::array<MemoFacet, 1U << kMemoBits> facetMemo_;
  bool overflowed_ = false;
  // Of this tick, besides casts; 1 for a triangle that is joined to another.
  mutable int work_ = 0;
  mutable int facetCasts_ = 0;
  std::array<std::uint32_t, FacetCache::kMaxTriangles> places_;  // of discs
  // Of the present cast of a point tool; -1: not known yet.
  mutable std::array<std::uint16_t, FacetCache::kMaxFacets> overlapped_;
  mutable int overlappedCount_ = -1;
  // Of a ball, in this tick: the place of the last cast, what the ball overlaps there, and how far the
  // nearest of that is.
  Vec3 overlappedFrom_ = Vec3::Zero();
  int overlappedOnly_ = -1;  // the object that was cast at; -1: all
  int overlappedTriangleCount_ = 0;
  std::array<FacetCache::TriangleId, FacetCache::kMaxTriangles> overlappedTriangles_;
  double nearestOverlapped2_ = 0;  // m^2
  bool cameFromBehind_ = false;    // the present cast heeds it
  std::uint64_t passable_ = 0;     // objects that the present cast does not meet
  bool pointTool_ = false;         // casts move the centre of the tool
};

template <class Visit>
void ContactQuery::forEachGathered(const Vec3& p, double distance, Visit&& visit) noexcept {
  if (keepsFacets_) {
    for (const Facet& f : cache_) visit(f);
    return;
  }
  if (std::isinf(distance)) {
    for (int i = 0; i < cache_.size(); ++i) {
      if (const Facet* const f = facetOf(cache_.triangle(i))) visit(*f);
    }
    return;
  }
  cache_.moveTo(p);
  const auto near = cache_.trianglesNear(Vec3::Zero(), distance, discs());
  countScans();
  for (const int i : near) {
    const Facet* const f = facetOf(cache_.triangle(i));
    if (f != nullptr) visit(*f);
  }
}

}  // namespace hapticd::realtime

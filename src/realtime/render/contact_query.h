// What is near the hand in this tick: placed objects, the facets around the proxy, and casts against them.
//
// A tick costs about one walk of the tree: the facets around the proxy are gathered once and the casts of the
// slide run over that array; only a path that leaves the gathered ball walks the tree again. The trees
// propose; every decision is made here in double precision, in the device frame, and does not depend on their
// order.
#pragma once

#include <array>
#include <cstdint>

#include "base/time.h"
#include "realtime/render/facet_cache.h"
#include "realtime/render/placed_planes.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using geometry::Affine;
using base::Nanos;

/// An object at this tick and, when it was there, at the last one.
struct PlacedObject {
  const scene::ObjectState* state = nullptr;
  Affine T_device_object = Affine::Identity();
  Affine T_object_device = Affine::Identity();
  double stretch = 1;            ///< most object units per metre, in any direction
  double skin = 0;               ///< see facet.h
  bool atRest = false;           ///< will not move or bend any more in this scene
  std::uint64_t restGeneration = 0;  ///< the generation in which it was found at rest
  bool mirrored = false;         ///< the placement has a reflection: winding is seen reversed
  // Since the last tick:
  const scene::ObjectState* before = nullptr;  ///< null when it was not there
  Affine T_device_objectBefore = Affine::Identity();
  bool moved = false;     ///< the placement changed
  bool deformed = false;  ///< vertices changed under the same triangles
  bool jumped = false;    ///< placement or triangles changed without passing between

  /// Corners in device metres.
  scene::Corners corners(std::uint32_t triangle, Nanos now) const noexcept;
  scene::Corners cornersBefore(std::uint32_t triangle, Nanos then) const noexcept;
  /// Where a point fixed to the object at the last tick is now.
  Vec3 carried(const Vec3& p) const noexcept;
};

/// The first obstacle on a path.
struct ObjectHit : CastHit {
  int object = 0;  ///< position among the near objects; -1 - position among the planes
  std::uint32_t triangle = 0;
};

/// The scene at a tick, kept to compare with the next one.
struct SceneAtTime {
  const scene::SceneSnapshot* scene = nullptr;
  Nanos time = 0;
};

/// Fixed storage; everything noexcept and allocation-free. Object positions are valid until the next begin().
class ContactQuery {
 public:
  explicit ContactQuery(double toolRadius_m) noexcept : radius_(toolRadius_m), cache_(toolRadius_m) {}

  /// Before a tick that does not follow the one before: what was kept of its scene may be gone.
  void invalidate() noexcept { ++generation_; }
  /// Starts a tick with no object near. `planes` are there from the start, and live until the next begin().
  void beginTick(const SceneAtTime& now, const SceneAtTime& before, const PlacedPlanes* planes = nullptr) noexcept;
  /// Adds the objects within `reach` of `centre`, and forgets what was gathered of others.
  void addObjectsNear(const Vec3& centre, double reach) noexcept;
  /// Adds one object by its id; -1 when it is not in the scene.
  int addObject(std::int32_t id) noexcept;

  int objectCount() const noexcept { return objectCount_; }
  const PlacedObject& object(int i) const noexcept { return objects_[static_cast<std::size_t>(i)]; }

  /// Gathers the facets that a tool inside the ball can meet; casts inside it then walk no tree. False when
  /// there are too many; casts walk the tree then.
  bool gather(const Vec3& centre, double radius) noexcept;
  /// The same; what is gathered already will do, in an earlier tick also, if it holds all that is wanted.
  /// More is gathered than that, so that this happens.
  bool ensureGathered(const Vec3& centre, double radius) noexcept;
  bool isGathered(const Vec3& p) const noexcept {
    return cache_.complete() && (p - cache_.centre()).squaredNorm() < 0.64 * cache_.reach() * cache_.reach();
  }
  /// Calls visit(facet) for at least every gathered facet within `distance` of p. The facet lives until the
  /// next one.
  template <class Visit>
  void forEachGathered(const Vec3& p, double distance, Visit&& visit) noexcept;

  /// First obstacle on the way from p to g; false when the way is free.
  bool cast(const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept;
  /// The same, when only the way's beginning matters: as far as it goes among the gathered facets.
  bool castWithinGathered(const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept;
  /// The same against one object only, always by its tree.
  bool castAtObject(int object, const Vec3& p, const Vec3& g, ObjectHit& hit) noexcept;

  /// Obstacle of one facet on the way from p to g.
  bool castAtFacet(const Facet& f, const Vec3& p, const Vec3& g, ObjectHit& hit) const noexcept;

  /// Smallest skin of the near objects: below a fraction of it, lengths mean nothing.
  double minSkin() const noexcept { return minSkin_; }
  /// Largest of the gathered facets.
  double maxSkin() const noexcept { return cache_.maxSkin(); }
  double toolRadius() const noexcept { return radius_; }
  scene::TouchableFaces faces() const noexcept { return now_.scene->faces; }
  /// True once something near had to be left out in this tick.
  bool overflowed() const noexcept { return overflowed_; }

 private:
  static constexpr int kMaxObjects = 64;
  static constexpr int kMemoBits = 8;

  // A facet that was made; generation 0 when it is none in the next tick.
  struct MemoFacet {
    std::uint64_t generation = 0;
    const scene::ObjectState* state = nullptr;
    Facet facet;
  };

  // The way p + t d, t in [0, limit], of a cast.
  struct Path {
    const Vec3& p;
    const Vec3& d;
    double limit;
  };

  template <class Visit>
  void forEachOnSegment(const Vec3& p, const Vec3& d, double limit, int only, Visit&& visit) const noexcept;
  void addObjectsByIndex(const scene::SceneSnapshot& scene, const Vec3& centre, double reach) noexcept;
  void add(const scene::ObjectState& state) noexcept;
  bool place(const scene::ObjectState& state, PlacedObject& placed) const noexcept;
  bool sameObjects() const noexcept;
  void compareWithBefore(PlacedObject& placed) const noexcept;
  const Facet* facetOf(int object, std::uint32_t triangle) const noexcept;
  void considerFacet(const Facet& f, const Path& path, ObjectHit& best, bool& found) const noexcept;
  bool castGathered(const Vec3& p, const Vec3& d, double limit, int only, ObjectHit& hit) noexcept;
  bool castPointGathered(const Path& path, int only, ObjectHit& hit) noexcept;
  bool castBallGathered(const Path& path, int only, ObjectHit& hit) noexcept;
  void considerGathered(int i, const Path& path, int only, ObjectHit& best, bool& found) noexcept;
  bool castTree(const Vec3& p, const Vec3& d, int only, ObjectHit& hit) const noexcept;
  bool castBallInSteps(const Vec3& p, const Vec3& d, double begin, int only, ObjectHit& hit) noexcept;

  double radius_;
  SceneAtTime now_;
  SceneAtTime before_;
  const PlacedPlanes* planes_ = nullptr;
  bool sameWorkspace_ = true;
  std::array<PlacedObject, kMaxObjects> objects_;
  int objectCount_ = 0;
  double minSkin_ = 0;
  FacetCache cache_;
  int lastBlocker_ = 0;  // the gathered facet that stopped a ball's last way
  // When and from what it was gathered; 0 when it will not do in another tick.
  std::uint64_t gatheredGeneration_ = 0;
  int gatheredCount_ = 0;
  std::array<const scene::ObjectState*, kMaxObjects> gatheredFrom_{};
  std::uint64_t generation_ = 1;  // of what may be kept from tick to tick
  mutable std::array<MemoFacet, 1U << kMemoBits> facetMemo_;
  bool overflowed_ = false;
};

template <class Visit>
void ContactQuery::forEachGathered(const Vec3& p, double distance, Visit&& visit) noexcept {
  if (radius_ == 0) {
    for (const Facet& f : cache_) visit(f);
    return;
  }
  cache_.moveTo(p);
  for (int i = 0; (i = cache_.nextWithin(distance, i)) < cache_.size(); ++i) {
    const Facet* const f = facetOf(cache_.triangle(i).object, cache_.triangle(i).triangle);
    if (f != nullptr) visit(*f);
  }
}

}  // namespace hapticd::realtime

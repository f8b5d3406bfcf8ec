#include "realtime/render/nearby.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace hapticd::realtime {
namespace {

using geometry::Mat3;
using scene::ObjectState;

constexpr double kRelativeSkin = 1e-9;      // of the largest coordinate of the object in the device frame
constexpr double kPadShare = 0x1p-22;       // of the object's size: a quarter of the pad of its index
constexpr double kRoundingFloor = 1e-12;    // of the largest coordinate: a thousand roundings
constexpr double kSmallestObject_m = 1e-3;  // below this size the coordinates of the hand decide the rounding
constexpr double kWiden = 1 + 1e-6;         // queries travel between frames with rounding
constexpr double kSpare = 0.2;              // of the tool's radius: gathered in reserve
constexpr int kLean = 32;                   // gathered facets that cost less than gathering anew

// An upper bound of the largest singular value, exact for similarities.
double stretchOf(const Mat3& m) {
  return std::sqrt((m.transpose() * m).cwiseAbs().rowwise().sum().maxCoeff());
}

scene::Corners mapped(const Affine& t, const scene::Corners& c, bool mirrored) {
  scene::Corners out{t * c.a, t * c.b, t * c.c};
  if (mirrored) std::swap(out.b, out.c);
  return out;
}

// Parameter at which p + t d leaves the ball, at most 1. p is inside.
double exitOf(const Vec3& p, const Vec3& d, const Vec3& centre, double radius) {
  const Vec3 m = p - centre;
  if ((m + d).squaredNorm() <= radius * radius) return 1;
  const double a = d.squaredNorm();
  const double b = m.dot(d);
  const double c = m.squaredNorm() - radius * radius;
  const double root = std::sqrt(std::max(0.0, b * b - a * c));
  return std::clamp((root - b) / a, 0.0, 1.0);
}

const ObjectState* find(const scene::SceneSnapshot& scene, std::int32_t id) {
  const auto it =
      std::lower_bound(scene.objects.begin(), scene.objects.end(), id,
                       [](const auto& object, std::int32_t wanted) { return object->id < wanted; });
  return it != scene.objects.end() && (*it)->id == id ? it->get() : nullptr;
}

}  // namespace

scene::Corners PlacedObject::corners(std::uint32_t triangle, Nanos now) const noexcept {
  return mapped(T_device_object, state->mesh->corners(triangle, now), mirrored);
}

scene::Corners PlacedObject::cornersBefore(std::uint32_t triangle, Nanos then) const noexcept {
  return mapped(T_device_objectBefore, before->mesh->corners(triangle, then), mirrored);
}

Vec3 PlacedObject::carried(const Vec3& p) const noexcept {
  if (!moved) return p;
  return T_device_object * (T_device_objectBefore.inverse() * p);
}

void Nearby::begin(const Moment& now, const Moment& before, const HalfSpaces* planes) noexcept {
  now_ = now;
  planes_ = planes;
  before_ = before;
  sameWorkspace_ = before.scene != nullptr && before.scene->workspace.T_device_world.matrix() ==
                                                  now.scene->workspace.T_device_world.matrix();
  objectCount_ = 0;
  finestSkin_ = kRelativeSkin;
  overflowed_ = false;
  if (now.scene != before.scene) forget();
}

void Nearby::include(const Vec3& centre, double reach) noexcept {
  const scene::SceneSnapshot& scene = *now_.scene;
  if (!scene.objectIndex || scene.objects.size() <= 2) {
    for (const auto& object : scene.objects) add(*object);
  } else {
    includeByIndex(scene, centre, reach);
  }
  if (gatheredIn_ != generation_ || !sameObjects()) ball_.drop();
}

void Nearby::includeByIndex(const scene::SceneSnapshot& scene, const Vec3& centre, double reach) noexcept {
  const Affine& T_world_device = scene.workspace.T_world_device;
  const double worldReach = (reach + radius_) * kWiden * stretchOf(T_world_device.linear());
  std::array<std::uint32_t, kMaxObjects> found{};
  std::size_t count = 0;
  scene.objectIndex->visitNear(T_world_device * centre, worldReach, [&](std::uint32_t i) noexcept {
    if (count == found.size()) {
      overflowed_ = true;
    } else {
      found[count++] = i;
    }
  });
  // By id, so that what happens to the proxy does not depend on the order of visits.
  std::sort(found.begin(), found.begin() + count);
  for (std::size_t k = 0; k < count; ++k) add(*scene.objects[found[k]]);
}

int Nearby::includeObject(std::int32_t id) noexcept {
  const ObjectState* state = find(*now_.scene, id);
  if (state == nullptr) return -1;
  add(*state);
  for (int i = 0; i < objectCount_; ++i) {
    if (object(i).state == state) return i;
  }
  return -1;
}

void Nearby::add(const ObjectState& state) noexcept {
  for (int i = 0; i < objectCount_; ++i) {
    if (object(i).state == &state) return;
  }
  if (objectCount_ == kMaxObjects) {
    overflowed_ = true;
    return;
  }
  PlacedObject& placed = objects_[static_cast<std::size_t>(objectCount_)];
  if (placed.restsSince == generation_ && placed.state == &state) {
    placed.before = &state;
    placed.T_device_objectBefore = placed.T_device_object;
    placed.moved = placed.deformed = placed.jumped = false;
  } else {
    if (!place(state, placed)) return;
    compareWithBefore(placed);
    if (placed.atRest) placed.restsSince = generation_;
  }
  ++objectCount_;
  finestSkin_ = objectCount_ == 1 ? placed.skin : std::min(finestSkin_, placed.skin);
}

bool Nearby::place(const ObjectState& state, PlacedObject& placed) const noexcept {
  placed = PlacedObject{};
  placed.state = &state;
  const geometry::Box& box = state.mesh->index.bounds();
  if (box.empty()) return false;
  placed.T_device_object = now_.scene->workspace.T_device_world * state.motion.at(now_.time);
  placed.atRest = !state.motion.movingAfter(now_.time) && !state.mesh->deformingAfter(now_.time);
  const Mat3 linear = placed.T_device_object.linear();
  const double determinant = linear.determinant();
  placed.mirrored = determinant < 0;
  placed.T_object_device = placed.T_device_object.inverse();
  placed.stretch = stretchOf(placed.T_object_device.linear());
  if (!std::isfinite(placed.stretch) || determinant == 0) return false;  // flattened: nothing to touch
  const Vec3 farthest =
      (placed.T_device_object * box.centre()).cwiseAbs() + linear.cwiseAbs() * (0.5 * box.extents());
  const double extent = std::max(farthest.maxCoeff(), kSmallestObject_m);
  const double size = 0.5 * box.extents().maxCoeff() / placed.stretch;
  placed.skin = std::max(std::min(kRelativeSkin * extent, kPadShare * size), kRoundingFloor * extent);
  return std::isfinite(placed.skin);
}

void Nearby::compareWithBefore(PlacedObject& placed) const noexcept {
  if (before_.scene == nullptr) return;
  const ObjectState& state = *placed.state;
  placed.before = find(*before_.scene, state.id);
  if (placed.before == nullptr) return;
  const ObjectState& before = *placed.before;
  placed.T_device_objectBefore = placed.T_device_object;
  if (!sameWorkspace_ || placed.before != &state || state.motion.movingAfter(before_.time)) {
    placed.T_device_objectBefore = before_.scene->workspace.T_device_world * before.motion.at(before_.time);
    placed.moved = placed.T_device_objectBefore.matrix() != placed.T_device_object.matrix();
  }
  const bool sameTriangles = before.mesh->topology == state.mesh->topology;
  placed.deformed = sameTriangles && (before.mesh != state.mesh || state.mesh->deformingAfter(before_.time));
  placed.jumped = !sameTriangles || before.motion.jumps() != state.motion.jumps();
}

// An object that will not move or bend any more in this scene has the same facets in each tick. Null for a
// triangle that is none; valid until the next call.
const Facet* Nearby::facetOf(int i, std::uint32_t triangle) const noexcept {
  const PlacedObject& placed = object(i);
  MadeFacet& made = made_[(triangle * 0x9E3779B1U) >> (32 - kMadeBits)];
  if (made.generation != generation_ || made.state != placed.state || made.facet.triangle != triangle) {
    made.generation = 0;
    if (!makeFacet(placed.corners(triangle, now_.time), placed.skin, made.facet)) return nullptr;
    made.facet.triangle = triangle;
    made.state = placed.state;
    if (placed.atRest) made.generation = generation_;
  }
  made.facet.object = i;
  return &made.facet;
}

bool Nearby::gather(const Vec3& centre, double radius) noexcept {
  ball_.begin(centre, radius);
  bool lasting = true;
  for (int i = 0; i < objectCount_; ++i) {
    const PlacedObject& placed = object(i);
    gatheredFrom_[static_cast<std::size_t>(i)] = placed.state;
    lasting = lasting && placed.atRest && !placed.deformed;
    const Vec3 inObject = placed.T_object_device * centre;
    // Deforming facets may have come from farther away.
    const auto visit = [&](std::uint32_t triangle) noexcept {
      if (!ball_.complete()) return;
      if (radius_ > 0) {
        const double distance = distanceBound(placed.state->mesh->corners(triangle, now_.time), inObject);
        ball_.add({triangle, i}, distance / (kWiden * placed.stretch), placed.skin, placed.deformed);
      } else if (const Facet* const facet = facetOf(i, triangle)) {
        ball_.add(*facet, placed.deformed);
      }
    };
    const double reach = radius + radius_ + 4 * placed.skin;
    placed.state->mesh->index.visitNear(inObject, reach * kWiden * placed.stretch, visit);
  }
  gatheredCount_ = objectCount_;
  gatheredIn_ = lasting ? generation_ : 0;
  return ball_.complete();
}

bool Nearby::surround(const Vec3& centre, double radius) noexcept {
  const double spare = kSpare * radius_;
  // What a fast tick has gathered is too much for the slow ones after it.
  const bool lean = ball_.size() <= kLean || ball_.reach() <= 2 * std::max(radius, spare);
  if (lean && ball_.covers(centre, radius)) return true;
  return (spare > radius && gather(centre, spare)) || gather(centre, radius);
}

bool Nearby::sameObjects() const noexcept {
  if (gatheredCount_ != objectCount_) return false;
  for (int i = 0; i < objectCount_; ++i) {
    if (gatheredFrom_[static_cast<std::size_t>(i)] != object(i).state) return false;
  }
  return true;
}

bool Nearby::meets(const Facet& f, const Vec3& p, const Vec3& g, Hit& hit) const noexcept {
  const Vec3 d = g - p;
  const bool found =
      radius_ > 0 ? meetBall(f, faces(), radius_, p, d, 1, 1, hit) : meet(f, faces(), p, d, 1, hit);
  hit.object = f.object;
  hit.triangle = f.triangle;
  return found;
}

// A total order on obstacles, so that the first one does not depend on the order of visits.
void Nearby::consider(const Facet& f, const Path& path, Hit& best, bool& found) const noexcept {
  Hit hit;
  const bool met = radius_ > 0 ? meetBall(f, faces(), radius_, path.p, path.d, path.limit,
                                          found ? best.stop : path.limit, hit)
                               : meet(f, faces(), path.p, path.d, path.limit, hit);
  if (!met) return;
  hit.object = f.object;
  hit.triangle = f.triangle;
  const auto rank = [this](const Hit& h) {
    return std::tuple(h.stop, -h.depth, h.object < 0 ? h.object : object(h.object).state->id, h.triangle);
  };
  if (found && !(rank(hit) < rank(best))) return;
  best = hit;
  found = true;
}

// visit returns the parameter in [0, 1] beyond which nothing more is wanted.
template <class Visit>
void Nearby::forEachOnSegment(const Vec3& p, const Vec3& d, double limit, int only,
                              Visit&& visit) const noexcept {
  if (only < 0 && planes_ != nullptr) {
    for (const HalfSpace& plane : *planes_) visit(plane.facet);
  }
  for (int i = 0; i < objectCount_; ++i) {
    if (only >= 0 && i != only) continue;
    const PlacedObject& placed = object(i);
    placed.state->mesh->index.visitSegment(placed.T_object_device * p,
                                           placed.T_object_device * (p + limit * d),
                                           [&](std::uint32_t triangle) noexcept {
                                             const Facet* const f = facetOf(i, triangle);
                                             return f != nullptr ? visit(*f) : 1.0;
                                           });
  }
}

bool Nearby::castGathered(const Vec3& p, const Vec3& d, double limit, int only, Hit& hit) noexcept {
  return radius_ > 0 ? meetBallOf({p, d, limit}, only, hit) : meetPoint({p, d, limit}, only, hit);
}

// Two passes: how far the path is free of faces, then what has to stop it before, so that at the stop it is a
// skin above all of them.
bool Nearby::meetPoint(const Path& path, int only, Hit& hit) noexcept {
  std::array<const Facet*, FacetBall::kMost + scene::kMaxPlanes> inTheWay;
  int count = ball_.crossing(path.p, path.d, path.limit, inTheWay.data());
  if (only < 0 && planes_ != nullptr) {
    for (const HalfSpace& plane : *planes_) inTheWay[static_cast<std::size_t>(count++)] = &plane.facet;
  }
  double free = path.limit;
  bool blocked = false;
  const auto forEach = [&](auto&& visit) {
    for (int i = 0; i < count; ++i) {
      const Facet& f = *inTheWay[static_cast<std::size_t>(i)];
      if (only < 0 || f.object == only) visit(f);
    }
  };
  forEach([&](const Facet& f) {
    const double t = reach(f, faces(), path.p, path.d, free);
    if (t > 1) return;
    blocked = true;
    free = t;
  });
  if (!blocked) return false;
  const Path way{path.p, path.d, free};
  bool found = false;
  forEach([&](const Facet& f) { consider(f, way, hit, found); });
  return found;
}

bool Nearby::meetBallOf(const Path& path, int only, Hit& hit) noexcept {
  ball_.moveTo(path.p);
  bool found = false;
  if (only < 0 && planes_ != nullptr) {
    for (const HalfSpace& plane : *planes_) consider(plane.facet, path, hit, found);
  }
  // What stopped it before will do so again: then nothing farther needs a closer look.
  const int first = stopper_;
  if (first < ball_.size()) considerGathered(first, path, only, hit, found);
  const double length = path.d.norm();
  const double touching = radius_ + 2 * ball_.thickestSkin();
  for (int i = 0;; ++i) {
    i = ball_.nextWithin(touching + (found ? hit.stop : path.limit) * length, i);
    if (i == ball_.size()) return found;
    if (i != first) considerGathered(i, path, only, hit, found);
  }
}

void Nearby::considerGathered(int i, const Path& path, int only, Hit& best, bool& found) noexcept {
  const FacetBall::Name& name = ball_.name(i);
  if (only >= 0 && name.object != only) return;
  const double touching = radius_ + 2 * ball_.thickestSkin();
  const double latest = found ? best.stop : path.limit;
  if (ball_.nearest(i, latest * path.d) > touching) return;
  const Facet* const f = facetOf(name.object, name.triangle);
  if (f == nullptr) return ball_.leaveOut(i);
  if (ball_.measured(i, nearestPointOf(*f, path.p), latest * path.d) > touching) return;
  consider(*f, path, best, found);
  if (found && best.stop < latest) stopper_ = i;
}

bool Nearby::castTree(const Vec3& p, const Vec3& d, int only, Hit& hit) const noexcept {
  double free = 1;
  bool blocked = false;
  forEachOnSegment(p, d, 1, only, [&](const Facet& f) noexcept {
    const double t = reach(f, faces(), p, d, free);
    if (t <= 1) {
      blocked = true;
      free = t;
    }
    return free;
  });
  if (!blocked) return false;
  bool found = false;
  const Path path{p, d, free};
  forEachOnSegment(p, d, free, only, [&](const Facet& f) noexcept {
    consider(f, path, hit, found);
    return 1.0;
  });
  return found;
}

// The index has no query for a swept ball: gather along the path from `begin` on, in steps that grow while
// nothing is in the way and shrink when the array overflows.
bool Nearby::castBall(const Vec3& p, const Vec3& d, double begin, int only, Hit& hit) noexcept {
  constexpr int kMaxSteps = 64;
  const double length = d.norm();
  double step = std::min(1.0, std::max(0.125 * radius_ / length, 1.0 / kMaxSteps));
  for (int i = 0; i < kMaxSteps && begin < 1; ++i) {
    step = std::min(step, 1 - begin);
    const Vec3 from = p + begin * d;
    surround(from + 0.5 * step * d, 0.5 * step * length * kWiden);
    if (!ball_.complete() && step > 1.0 / kMaxSteps) {
      step *= 0.25;
      continue;
    }
    overflowed_ = overflowed_ || !ball_.complete();
    if (castGathered(from, step * d, 1, only, hit)) {
      hit.stop = begin + step * hit.stop;
      return true;
    }
    begin += step;
    step *= 2;
  }
  return false;
}

bool Nearby::cast(const Vec3& p, const Vec3& g, Hit& hit) noexcept {
  const Vec3 d = g - p;
  double free = 0;
  if (ball_.covers(p, 0)) {
    free = exitOf(p, d, ball_.centre(), ball_.reach());
    if (castGathered(p, d, free, -1, hit)) return true;
    if (free == 1) return false;
  }
  return radius_ > 0 ? castBall(p, d, free, -1, hit) : castTree(p, d, -1, hit);
}

bool Nearby::castBeginning(const Vec3& p, const Vec3& g, Hit& hit) noexcept {
  if (!gathered(p)) return cast(p, g, hit);
  const Vec3 d = g - p;
  return castGathered(p, d, exitOf(p, d, ball_.centre(), ball_.reach()), -1, hit);
}

bool Nearby::castAt(int object, const Vec3& p, const Vec3& g, Hit& hit) noexcept {
  return radius_ > 0 ? castBall(p, g - p, 0, object, hit) : castTree(p, g - p, object, hit);
}

}  // namespace hapticd::realtime

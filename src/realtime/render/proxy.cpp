#include "realtime/render/proxy.h"

#include <algorithm>
#include <cmath>

#include "realtime/render/renderer.h"

namespace hapticd::realtime {
namespace {

constexpr int kMaxCasts = 128;             // in one tick; a path over 0.2 mm cells at 1 m/s needs about 20
constexpr int kHoldCasts = 32;             // kept back for finding what holds it at the end
constexpr double kJump_m = 0.030;          // farther in one tick is a jump, not a motion
constexpr double kRestick_m = 0.5e-6;      // slower than this in a tick is at rest
constexpr double kGatherMargin_m = 10e-6;  // the tremor of a hand
constexpr double kBallConvergence = 1e-6;  // of the radius, in distance to the target
constexpr int kMaxPushes = 8;

// Depth below the held planes as they really are, without the skin that keeps the proxy off them.
Vec3 depthsOf(const Hit* hits, int count, const Nearby& nearby, const Vec3& hip, double* depths) {
  std::array<Plane, kMaxActive> planes;
  std::array<double, kMaxActive> standoffs{};
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    planes[k] = hits[i].plane;
    standoffs[k] = nearby.toolRadius();
  }
  depthsBelow(planes.data(), count, standoffs.data(), hip, depths);
  Vec3 normal = Vec3::Zero();
  for (int i = 0; i < count; ++i) normal += depths[i] * hits[i].plane.normal;
  return normal;
}

}  // namespace

const Grip& Proxy::follow(const Moment& now, const Vec3& hip, double period_s,
                          std::uint32_t& status) noexcept {
  now_ = now;
  period_s_ = period_s;
  casts_ = 0;
  if (!placed_) place(now, hip);
  nearby_.begin(now, before_);
  const bool wasFree = grip_.count == 0;
  const Vec3 from = position_;
  carry(hip, status);
  stride_m_ = (hip - hipBefore_).norm() + (position_ - from).norm();
  push(from, status);
  if (grip_.count > 0) nearby_.gather(position_, 1.5 * stride_m_ + kGatherMargin_m);
  chase(hip);
  popThrough(hip, status);
  releaseWhenDeep(wasFree, status);
  if (casts_ >= kMaxCasts) status |= kRenderIterationLimit;
  if (nearby_.overflowed()) status |= kRenderCandidateLimit;
  before_ = now;
  positionBefore_ = position_;
  hipBefore_ = hip;
  return grip_;
}

void Proxy::place(const Moment& now, const Vec3& hip) noexcept {
  placed_ = true;
  armed_ = true;
  released_ = false;
  position_ = positionBefore_ = hipBefore_ = hip;
  grip_ = Grip{};
  before_ = now;
  touchedObject_ = -1;
}

// The proxy stays where it touched the object, however that moved or bent.
void Proxy::carry(const Vec3& hip, std::uint32_t& status) noexcept {
  if (grip_.count > 0) {
    const int touched = nearby_.includeObject(touchedObject_);
    if (touched < 0) {
      status |= kRenderGeometryJump;
    } else {
      const PlacedObject& object = nearby_.object(touched);
      const Vec3 carried = carriedBy(object, touchedTriangle_, position_);
      if (object.jumped) status |= kRenderGeometryJump;
      if ((carried - position_).norm() <= kJump_m) {
        position_ = carried;
      } else {
        status |= kRenderGeometryJump;
        position_ = hip;
        grip_ = Grip{};
      }
    }
  }
  // All that happens in this tick is at most this far from the HIP.
  nearby_.include(hip, std::max((position_ - hip).norm(), (positionBefore_ - hip).norm()) + kGatherMargin_m);
}

Vec3 Proxy::carriedBy(const PlacedObject& object, std::uint32_t triangle, const Vec3& p) const noexcept {
  if (object.before == nullptr) return p;
  Facet then;
  Facet now;
  if (!object.deformed || !makeFacet(object.cornersBefore(triangle, before_.time), 0, then) ||
      !makeFacet(object.corners(triangle, now_.time), 0, now)) {
    return object.carried(p);
  }
  // makeFacet turns the corners by the longest edge, which may differ: take them as they come.
  const scene::Corners t = object.cornersBefore(triangle, before_.time);
  const scene::Corners n = object.corners(triangle, now_.time);
  geometry::Mat3 frame;
  frame << t.b - t.a, t.c - t.a, then.normal;
  const Vec3 local = frame.inverse() * (p - t.a);
  return n.a + local.x() * (n.b - n.a) + local.y() * (n.c - n.a) + local.z() * now.normal;
}

// Geometry that passed over the proxy takes it along: cast in the frame of what moved, from where the proxy
// was in it to where it is now.
void Proxy::push(const Vec3& from, std::uint32_t& status) noexcept {
  const bool carried = position_ != from;
  bool deforming = false;
  for (int i = 0; i < nearby_.objectCount(); ++i) {
    const PlacedObject& object = nearby_.object(i);
    deforming = deforming || object.deformed;
    if (!(object.moved || carried) || object.deformed || object.jumped || object.before == nullptr) continue;
    const Vec3 start = object.carried(from);
    const Vec3 way = position_ - start;
    if (way.norm() > kJump_m) {
      status |= kRenderGeometryJump;
      continue;
    }
    Hit hit;
    if (way.squaredNorm() > 0 && nearby_.castAt(i, start, position_, hit)) {
      position_ = start + hit.stop * way;
      stride_m_ += way.norm();
      touchedObject_ = object.state->id;
    }
  }
  if (deforming) pushByDeforming(from);
}

void Proxy::pushByDeforming(const Vec3& from) noexcept {
  for (int k = 0; k < kMaxPushes; ++k) {
    nearby_.gather(position_, stride_m_ + kGatherMargin_m);
    bool pushed = false;
    for (const Facet* f = nearby_.facetsBegin(); f != nearby_.facetsEnd() && !pushed; ++f) {
      const PlacedObject& object = nearby_.object(f->object);
      if (!object.deformed) continue;
      const Vec3 start = carriedBy(object, f->triangle, from);
      Hit hit;
      if ((position_ - start).norm() > kJump_m || !nearby_.meets(*f, start, position_, hit)) continue;
      const double below = hit.plane.height(position_);
      if (below > -0.25 * f->skin) continue;
      position_ -= below * hit.plane.normal;
      pushed = true;
    }
    if (!pushed) return;
  }
}

bool Proxy::frictionless() const noexcept {
  for (int i = 0; i < nearby_.objectCount(); ++i) {
    if (nearby_.object(i).state->surface.static_friction > 0) return false;
  }
  return true;
}

// Sticks, or slides until friction bears the rest.
void Proxy::chase(const Vec3& hip) noexcept {
  ActiveSet active;
  if (frictionless()) {
    slide(hip, active);
    describe(hip, position_, active);
    return;
  }
  const bool wasSliding = grip_.sliding && grip_.count > 0;
  hold(hip, active);
  if (grip_.count == 0) return;
  const Vec3 normal = [&] {
    std::array<double, kMaxActive> depths{};
    return depthsOf(active.hits.data(), active.count, nearby_, hip, depths.data());
  }();
  double staticFriction = 0;
  double dynamicFriction = 0;
  double weight = 0;
  for (int i = 0; i < grip_.count; ++i) {
    const Touch& touch = grip_.touches[static_cast<std::size_t>(i)];
    const scene::Surface& surface = touch.object->surface;
    const double force = surface.stiffness_N_per_m * touch.depth_m;
    staticFriction += force * surface.static_friction;
    dynamicFriction += force * std::min(surface.dynamic_friction, surface.static_friction);
    weight += force;
  }
  if (weight > 0) {
    staticFriction /= weight;
    dynamicFriction /= weight;
  }
  const double lateral = grip_.lateral_m.norm();
  const bool reversed = wasSliding && grip_.lateral_m.dot(slipDirection_) < 0;
  const bool sliding = wasSliding && !reversed;
  if (lateral <= (sliding ? dynamicFriction : staticFriction) * normal.norm()) {
    grip_.sliding = false;
    return;
  }
  slipDirection_ = grip_.lateral_m / lateral;
  const Vec3 start = position_;
  ActiveSet slid;
  slide(hip + slipDirection_ * (dynamicFriction * normal.norm()), slid);
  const bool moved = (position_ - start).norm() >= kRestick_m;
  hold(hip, active);
  grip_.sliding = moved;
}

// To the target as near as the surfaces let it, without friction. Each approach drops the planes of the one
// before, so that only what really stands in the way holds the proxy; it ends when that brings it no nearer.
void Proxy::slide(const Vec3& target, ActiveSet& active) noexcept {
  const double skin = nearby_.finestSkin();
  // A point comes to rest on planes in finitely many approaches; a ball on edges and corners only converges.
  const double gain = std::max(1e-4 * skin, kBallConvergence * nearby_.toolRadius());
  // A proxy within the skin is first put back outside.
  double nearest = (position_ - target).norm() + 4 * skin;
  while (casts_ < kMaxCasts) {
    active.count = 0;
    Vec3 goal;
    if (approach(target, false, active, goal)) return;
    const double distance = (position_ - target).norm();
    if (!(distance < nearest - gain)) return;
    nearest = distance;
  }
}

// Finds what holds the proxy where it is; moves it only as long as nothing does.
void Proxy::hold(const Vec3& hip, ActiveSet& active) noexcept {
  active.count = 0;
  Vec3 goal = hip;
  approach(hip, true, active, goal);
  describe(hip, goal, active);
}

// One approach with planes gathered on the way. `goal` is the point nearest to the target above them. With
// `hold`, the first plane stops it. True when the target was reached and nothing holds.
bool Proxy::approach(const Vec3& target, bool hold, ActiveSet& active, Vec3& goal) noexcept {
  const double skin = nearby_.finestSkin();
  const int limit = hold ? kMaxCasts + kHoldCasts : kMaxCasts;
  std::array<Plane, kMaxPlanes> planes;
  while (casts_ < limit) {
    for (int i = 0; i < active.count; ++i) {
      planes[static_cast<std::size_t>(i)] = active.hits[static_cast<std::size_t>(i)].plane;
    }
    const NearestPoint nearest = nearestAbove(planes.data(), active.count, target, position_, skin / 16);
    goal = nearest.point;
    if (!nearest.found) break;  // jammed
    const ActiveSet all = active;
    active.count = nearest.count;
    for (int i = 0; i < nearest.count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      active.hits[k] = all.hits[static_cast<std::size_t>(nearest.active[k])];
    }
    const Vec3 way = goal - position_;
    if (way.norm() <= 1e-3 * skin) return active.count == 0;
    ++casts_;
    Hit hit;
    if (!nearby_.cast(position_, goal, hit)) {
      if (hold && active.count > 0) return false;
      position_ = goal;
      return active.count == 0;
    }
    const double move = hit.stop * way.norm();
    if (hold && active.count > 0 && move > skin) return false;
    if (!hold || move > skin) position_ += hit.stop * way;
    if (!nearby_.gathered(position_)) nearby_.gather(position_, 1.5 * stride_m_ + kGatherMargin_m);
    active.hits[static_cast<std::size_t>(active.count++)] = hit;
  }
  // Without a solution for all of them: what held before the newcomer.
  active.count = std::clamp(active.count - 1, std::min(active.count, 1), kMaxActive);
  return false;
}

void Proxy::describe(const Vec3& hip, const Vec3& goal, const ActiveSet& active) noexcept {
  grip_ = Grip{};
  const int count = std::min(active.count, kMaxActive);
  std::array<double, kMaxActive> depths{};
  depthsOf(active.hits.data(), count, nearby_, hip, depths.data());
  double hardest = 0;
  for (int i = 0; i < count; ++i) {
    const Hit& hit = active.hits[static_cast<std::size_t>(i)];
    const PlacedObject& object = nearby_.object(hit.object);
    Touch& touch = grip_.touches[static_cast<std::size_t>(grip_.count++)];
    touch.object = object.state;
    touch.triangle = hit.triangle;
    touch.plane = hit.plane;
    touch.depth_m = depths[static_cast<std::size_t>(i)];
    const Vec3 carried = carriedBy(object, hit.triangle, positionBefore_);
    if (!object.jumped) touch.objectVelocity_m_per_s = (carried - positionBefore_) / period_s_;
    const double force = object.state->surface.stiffness_N_per_m * touch.depth_m;
    if (i == 0 || force > hardest) {
      hardest = force;
      touchedObject_ = object.state->id;
      touchedTriangle_ = hit.triangle;
    }
  }
  grip_.lateral_m = count > 0 ? Vec3(position_ - goal) : Vec3::Zero();
  if (count == 0) armed_ = true;
}

// Pressed too hard, the proxy steps through the faces that hold it and goes on to the hand.
void Proxy::popThrough(const Vec3& hip, std::uint32_t& status) noexcept {
  if (!armed_) return;
  Vec3 out = Vec3::Zero();
  bool pressed = false;
  for (int i = 0; i < grip_.count; ++i) {
    const Touch& touch = grip_.touches[static_cast<std::size_t>(i)];
    const scene::Surface& surface = touch.object->surface;
    out += touch.depth_m * touch.plane.normal;
    pressed = pressed ||
              (surface.popthrough_N > 0 && surface.stiffness_N_per_m * touch.depth_m > surface.popthrough_N);
  }
  if (!pressed) return;
  const Vec3 direction = -out.normalized();
  double step = 0;
  for (int i = 0; i < grip_.count; ++i) {
    const Plane& plane = grip_.touches[static_cast<std::size_t>(i)].plane;
    const double fall = -plane.normal.dot(direction);
    if (fall > 0.1) step = std::max(step, (plane.height(position_) + 2 * plane.standoff) / fall);
  }
  position_ += step * direction;
  status |= kRenderPopthrough;
  chase(hip);
  armed_ = grip_.count == 0;
}

// A first contact this deep did not come from a hand's motion.
void Proxy::releaseWhenDeep(bool wasFree, std::uint32_t& status) noexcept {
  if (grip_.count == 0) {
    released_ = false;
    return;
  }
  Vec3 normal = Vec3::Zero();
  for (int i = 0; i < grip_.count; ++i) {
    const Touch& touch = grip_.touches[static_cast<std::size_t>(i)];
    normal += touch.depth_m * touch.plane.normal;
  }
  if (wasFree && normal.norm() > kJump_m) released_ = true;
  if (released_) status |= kRenderReleased;
}

}  // namespace hapticd::realtime

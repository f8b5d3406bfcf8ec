#include "realtime/render/proxy.h"

#include <algorithm>
#include <cmath>

#include "realtime/render/force_shading.h"
#include "realtime/render/renderer.h"

namespace hapticd::realtime {
namespace {

constexpr int kHoldCasts = 32;             // of a tick, kept back for finding what holds it at the end
constexpr double kRestick_m = 0.5e-6;      // slower than this in a tick is at rest
constexpr double kBallConvergence = 1e-8;  // of the radius, in distance to the target

// Depths of the HIP below the held faces as they really are, without the skin that keeps the proxy off them.
// False when the proxy is not on all of them, jammed where they leave it no room: then no more than the
// spring's length.
bool depthsOf(const Hit* hits, int count, double toolRadius_m, const Vec3& spring, const Vec3& hip,
              double* depths) {
  std::array<Plane, kMaxActive> planes;
  for (int i = 0; i < count; ++i) {
    planes[static_cast<std::size_t>(i)] = hits[i].plane;
    planes[static_cast<std::size_t>(i)].standoff = toolRadius_m;
  }
  depthsBelow(planes.data(), count, hip, depths);
  Vec3 normal = Vec3::Zero();
  for (int i = 0; i < count; ++i) normal += depths[i] * hits[i].plane.normal;
  if (normal.squaredNorm() <= spring.squaredNorm()) return true;
  for (int i = 0; i < count; ++i) depths[i] *= spring.norm() / normal.norm();
  return false;
}

}  // namespace

const Grip& Proxy::follow(const Moment& now, const Vec3& hip, double period_s,
                          std::uint32_t& status) noexcept {
  now_ = now;
  period_s_ = period_s;
  casts_ = 0;
  if (!placed_) place(now, hip);
  planes_.place(*now.scene, now.time, hip, position_, nearby_.toolRadius());
  nearby_.begin(now, before_, &planes_);
  const bool wasFree = grip_.count == 0;
  const Vec3 from = position_;
  carry(hip, status);
  stride_m_ = (hip - hipBefore_).norm() + (position_ - from).norm();
  push(from, status);
  if (grip_.count > 0) nearby_.surround(position_, 1.5 * stride_m_ + kGatherMargin_m);
  chase(hip);
  popThrough(hip, status);
  releaseWhenDeep(wasFree, status);
  if (forceShading_) shade();
  unsigned touched = 0;
  for (int i = 0; i < grip_.count; ++i) {
    const int source = grip_.touches[static_cast<std::size_t>(i)].source;
    if (source < 0) touched |= 1U << (-1 - source);
  }
  planes_.remember(touched, position_);
  if (casts_ >= kMaxCasts) status |= kRenderIterationLimit;
  if (nearby_.overflowed()) status |= kRenderCandidateLimit;
  before_ = now;
  positionBefore_ = position_;
  hipBefore_ = hip;
  return grip_;
}

void Proxy::reset() noexcept {
  placed_ = false;
  planes_.reset();
}

void Proxy::place(const Moment& now, const Vec3& hip) noexcept {
  placed_ = true;
  armed_ = true;
  released_ = false;
  position_ = positionBefore_ = hipBefore_ = hip;
  grip_ = Grip{};
  nearby_.forget();
  before_ = now;
  touchedObject_ = -1;
}

bool Proxy::frictionless() const noexcept {
  for (int i = 0; i < nearby_.objectCount(); ++i) {
    if (nearby_.object(i).state->surface.static_friction > 0) return false;
  }
  for (const HalfSpace& plane : planes_) {
    if (plane.surface.static_friction > 0 || plane.state->adhesionLateral_N > 0) return false;
  }
  return true;
}

// What friction at a grip can bear, as a length of the spring.
Proxy::Cone Proxy::coneOf(const Grip& grip) noexcept {
  Cone cone;
  double adhesion = 0;
  double weight = 0;
  for (int i = 0; i < grip.count; ++i) {
    const Touch& touch = grip.touches[static_cast<std::size_t>(i)];
    const double force = touch.surface.stiffness_N_per_m * touch.depth_m;
    cone.sticking_m += force * touch.surface.static_friction;
    cone.sliding_m += force * std::min(touch.surface.dynamic_friction, touch.surface.static_friction);
    adhesion += touch.adhesion_N;
    weight += force;
  }
  const double depth = grip.normal_m.norm();
  if (!(weight > 0) || !(depth > 0)) return {};
  const double held = adhesion * depth / weight;
  cone.sticking_m = cone.sticking_m * depth / weight + held;
  cone.sliding_m = cone.sliding_m * depth / weight + held;
  return cone;
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
  const Cone cone = coneOf(grip_);
  const double lateral = grip_.lateral_m.norm();
  const bool reversed = grip_.lateral_m.dot(slipDirection_) < 0;
  if (lateral <= (wasSliding && !reversed ? cone.sliding_m : cone.sticking_m)) return;

  slipDirection_ = grip_.lateral_m / lateral;
  const Vec3 start = position_;
  slide(hip + slipDirection_ * cone.sliding_m, active);
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
  Vec3 stride = Vec3::Zero();
  while (casts_ < kMaxCasts) {
    const Vec3 from = position_;
    const ActiveSet held = active;
    if (!stride.isZero(0)) leap(stride, target);
    active.count = 0;
    Vec3 goal;
    if (approach(target, false, active, goal)) return;
    double distance = (position_ - target).norm();
    if (!(distance < nearest - gain)) {
      if (!stride.isZero(0)) {
        position_ = from;
        active = held;
        stride.setZero();
        continue;
      }
      if (active.count < 2 || !escape(target, active)) return;
      distance = (position_ - target).norm();
    }
    nearest = distance;
    if (nearby_.toolRadius() > 0) stride = position_ - from;
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
    // What holds the proxy besides is where it is, not far on the way.
    const bool held = hold && active.count > 0;
    if (!(held ? nearby_.castBeginning(position_, goal, hit) : nearby_.cast(position_, goal, hit))) {
      if (held) return false;
      position_ = goal;
      return active.count == 0;
    }
    const double move = hit.stop * way.norm();
    if (held && move > skin) return false;
    if (!hold || move > skin) position_ += hit.stop * way;
    if (!nearby_.gathered(position_)) nearby_.surround(position_, 1.5 * stride_m_ + kGatherMargin_m);
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
  const bool onAll =
      depthsOf(active.hits.data(), count, nearby_.toolRadius(), position_ - hip, hip, depths.data());
  double hardest = -1;
  for (int i = 0; i < count; ++i) {
    const Hit& hit = active.hits[static_cast<std::size_t>(i)];
    Touch& touch = grip_.touches[static_cast<std::size_t>(grip_.count++)];
    touch.source = hit.object;
    touch.triangle = hit.triangle;
    touch.plane = hit.plane;
    touch.push = hit.plane.normal;
    touch.depth_m = depths[static_cast<std::size_t>(i)];
    grip_.normal_m += touch.depth_m * touch.plane.normal;
    if (hit.object < 0) {
      const HalfSpace& plane = planes_[-1 - hit.object];
      touch.surface = plane.surface;
      touch.adhesion_N = plane.state->adhesionLateral_N;
    } else {
      const PlacedObject& object = nearby_.object(hit.object);
      touch.object = object.state->id;
      touch.surface = object.state->surface;
      if (!object.jumped) {
        const Vec3 carried = carriedBy(object, hit.triangle, positionBefore_);
        touch.surfaceVelocity_m_per_s = (carried - positionBefore_) / period_s_;
      }
    }
    const double force = touch.surface.stiffness_N_per_m * touch.depth_m;
    if (force > hardest) {
      hardest = force;
      touchedObject_ = touch.object;
      touchedTriangle_ = touch.triangle;
    }
  }
  if (count > 0 && onAll) grip_.lateral_m = position_ - goal;
  if (count == 0) armed_ = true;
}

// Pressed too hard, the proxy steps through the faces that hold it and goes on to the hand.
void Proxy::popThrough(const Vec3& hip, std::uint32_t& status) noexcept {
  if (!armed_) return;
  bool pressed = false;
  for (int i = 0; i < grip_.count; ++i) {
    const Touch& touch = grip_.touches[static_cast<std::size_t>(i)];
    const scene::Surface& surface = touch.surface;
    pressed = pressed ||
              (surface.popthrough_N > 0 && surface.stiffness_N_per_m * touch.depth_m > surface.popthrough_N);
  }
  if (!pressed) return;
  const Vec3 direction = -grip_.normal_m.normalized();
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

void Proxy::shade() noexcept {
  for (int i = 0; i < grip_.count; ++i) {
    Touch& touch = grip_.touches[static_cast<std::size_t>(i)];
    if (touch.source < 0) continue;
    const Vec3 at = position_ - nearby_.toolRadius() * touch.plane.normal;
    touch.push =
        shadedNormal(nearby_.object(touch.source), touch.triangle, now_.time, touch.plane.normal, at);
  }
}

// A first contact this deep did not come from a hand's motion.
void Proxy::releaseWhenDeep(bool wasFree, std::uint32_t& status) noexcept {
  if (grip_.count == 0) {
    released_ = false;
    return;
  }
  if (wasFree && grip_.normal_m.norm() > kJump_m) released_ = true;
  if (released_) status |= kRenderReleased;
}

}  // namespace hapticd::realtime

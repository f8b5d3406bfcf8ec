// Friction of a proxy that geometry moved: back onto the faces that it was moved off, and in a groove whose
// walls move differently.
#include <algorithm>
#include <cmath>

#include "realtime/render/proxy.h"
#include "realtime/render/surface_law.h"
#include "realtime/render/yielding.h"

namespace hapticd::realtime {
namespace {

// The place s with the least (s - spring)^2 / 2 + sum of bound_i |s - carried_i|: the wall at the first place
// pulls down from above it, and up from below; so does the second.
double balanceOf(double spring, double first, double boundOfFirst, double second, double boundOfSecond) {
  if (first > second) return balanceOf(spring, second, boundOfSecond, first, boundOfFirst);
  const double below = spring + boundOfFirst + boundOfSecond;
  if (below < first) return below;
  const double above = spring - boundOfFirst - boundOfSecond;
  if (above > second) return above;
  return std::clamp(spring - boundOfFirst + boundOfSecond, first, second);
}

}  // namespace

// The damper of a HIP that leaves takes a part of the pressure, and friction bears what the rest of it
// allows. A proxy that stuck beyond that would fill a spring into which the hand puts nothing.
void Proxy::findPressure() noexcept {
  const auto first = contactSet_.constraints.begin();
  const auto damps = [this](const ContactConstraint& c) {
    return c.surface.damping_Ns_per_m > 0 && c.leavingSpeed(hipVelocity_m_per_s_) > 0;
  };
  if (std::none_of(first, first + contactSet_.count, damps)) return;
  const Springs springs = springsOf(contactSet_, toolRadius_);
  const std::array<double, kMaxActive> pressed_N = normalForces(contactSet_, springs, hipVelocity_m_per_s_);
  for (std::size_t i = 0; i < static_cast<std::size_t>(contactSet_.count); ++i) {
    const double spring_N = springs.forces_N[i];
    if (pressed_N[i] < spring_N) contactSet_.constraints[i].pressed = pressed_N[i] / spring_N;
  }
}

// What the slope of the stiffness holds of the lateral part, as a length of the spring.
Vec3 Proxy::heldBySlope() const noexcept {
  const BlendedSpring& spring = contactSet_.spring;
  if (!(spring.stiffness_N_per_m > 0)) return Vec3::Zero();
  return spring.slope_N / spring.stiffness_N_per_m;
}

bool Proxy::slips() noexcept {
  contactSet_.staticShare = slidingShare();
  return (contactSet_.lateral_m - heldBySlope()).norm() > frictionConeOf(contactSet_);
}

// A face that moves, or that pushes or carries the proxy, may leave it a little above the others that hold
// it. It never left them: the tick only moves one after the other. Without them, their normal part of the
// spring would count as a lateral part, which friction cannot bear.
void Proxy::pressBack(const Vec3& hip, ActiveSet& active) noexcept {
  for (int i = 0; i < kMaxActive - 1 && contactSet_.count > 0 && slips(); ++i) {
    if (!pressOnLostFace(hip, active)) return;
    findConstraints(hip, active);
  }
}

// True when the proxy moved on to a face that it lost. It moves along the normals alone: along the faces,
// friction holds it.
bool Proxy::pressOnLostFace(const Vec3& hip, const ActiveSet& active) noexcept {
  if (casts_ >= kMaxCasts || query_.workSpent()) return false;
  const Vec3 held = heldBySlope();
  const Vec3 pull = (contactSet_.lateral_m - held).normalized();
  const Projection slide = nearestTo(hip + held + pull * frictionConeOf(contactSet_), active);
  if (!slide.found) return false;
  Vec3 end = slide.point;
  query_.shorten(position_, end);
  ObjectHit face;
  ++casts_;
  if (!query_.cast(position_, end, face) || face.unexamined || !isLost(face)) return false;
  ActiveSet all = active;
  all.hits[static_cast<std::size_t>(all.count++)] = face;
  const Projection nearest = nearestTo(hip, all);
  const auto last = nearest.active.begin() + nearest.count;
  if (!nearest.found || std::find(nearest.active.begin(), last, all.count - 1) == last) return false;
  all.keep(nearest);
  const Vec3 way = alongNormals(all, nearest.point - position_);
  if (!(way.norm() <= (end - position_).norm() + 4 * query_.minSkin())) return false;
  ObjectHit stop;
  ++casts_;
  position_ += (query_.cast(position_, position_ + way, stop) ? stop.stop : 1.0) * way;
  return true;
}

Vec3 Proxy::alongNormals(const ActiveSet& active, const Vec3& way) noexcept {
  const Vec3& first = active.hits[0].halfSpace.normal;
  if (active.count == 1) return first * first.dot(way);
  if (active.count > 2) return way;
  const Vec3 along = first.cross(active.hits[1].halfSpace.normal).normalized();
  return way - along * along.dot(way);
}

// More faces like it held the proxy in the last tick.
bool Proxy::isLost(const ObjectHit& face) const noexcept {
  constexpr double kTurned = 0.99;  // cosine; a face that slides or deforms may be another triangle
  const std::int32_t object = face.object < 0 ? -1 : query_.object(face.object).state->id;
  const auto alike = [&](const auto& c) {
    return c.object == object && c.halfSpace.normal.dot(face.halfSpace.normal) > kTurned;
  };
  const auto& now = contactSet_.constraints;
  return std::count_if(lastConstraints_.begin(), lastConstraints_.begin() + lastCount_, alike) >
         std::count_if(now.begin(), now.begin() + contactSet_.count, alike);
}

// Along a groove the proxy has one way to go, and each wall its own place where it would have taken it.
std::optional<Proxy::Groove> Proxy::movingGroove() noexcept {
  const auto& walls = contactSet_.constraints;
  if (contactSet_.count != 2 || (walls[0].rests && walls[1].rests)) return std::nullopt;
  if (!(contactSet_.spring.stiffness_N_per_m > 0)) return std::nullopt;
  contactSet_.staticShare = slidingShare();
  Groove groove;
  groove.along = walls[0].halfSpace.normal.cross(walls[1].halfSpace.normal).normalized();
  bool slipped = false;
  for (std::size_t i = 0; i < 2; ++i) {
    groove.carried[i] = groove.along.dot(positionBefore_ + walls[i].carried_m - position_);
    groove.bound[i] = contactSet_.boundOf(walls[i]);
    slipped = slipped || (groove.bound[i] > 0 && std::abs(groove.carried[i]) > query_.minSkin());
  }
  if (!slipped) return std::nullopt;
  return groove;
}

// Each wall pulls the proxy to where it carried it, with its bound at most; the proxy goes where they balance
// the spring.
bool Proxy::slideInMovingGroove(const Vec3& hip, ActiveSet& active) noexcept {
  const std::optional<Groove> groove = movingGroove();
  if (!groove) return false;
  const Vec3 held = heldBySlope();
  const Vec3 borne = contactSet_.lateral_m - held;
  if (!borne.isZero(0)) slide_.direction = borne.normalized();
  const auto& [first, second] = groove->carried;
  const double place =
      balanceOf(-groove->along.dot(borne), first, groove->bound[0], second, groove->bound[1]);
  // Over the walls on average, by what they bear.
  const double slip =
      (groove->bound[0] * std::abs(place - first) + groove->bound[1] * std::abs(place - second)) /
      (groove->bound[0] + groove->bound[1]);
  if (place != 0) {
    const Vec3 way = position_ + place * groove->along - hip - held;
    moveFrictionless(hip + held + groove->along * groove->along.dot(way), active);
    findConstraints(hip, active);
  }
  advanceSlide(slip);
  contactSet_.staticShare = slidingShare();
  if (const std::optional<Groove> now = movingGroove()) shareOut(*now);
  return true;
}

// The wall that the proxy slipped over farther bears its bound, or as much as the other one leaves, and that
// the rest.
void Proxy::shareOut(const Groove& groove) noexcept {
  const std::size_t farther = std::abs(groove.carried[1]) > std::abs(groove.carried[0]) ? 1 : 0;
  const Vec3 borne = contactSet_.lateral_m - heldBySlope();
  const double bound = groove.bound[farther];
  const double rest = groove.bound[1 - farther];
  const double all = borne.dot(groove.along);
  const double part = std::clamp(std::copysign(bound, groove.carried[farther]), all - rest, all + rest);
  const Vec3 friction = std::clamp(part, -bound, bound) * groove.along;
  contactSet_.borneApart = true;
  contactSet_.borneByFirst_m = farther == 0 ? friction : Vec3(borne - friction);
}

}  // namespace hapticd::realtime

#include "realtime/render/proxy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "realtime/render/force_shading.h"
#include "realtime/render/renderer.h"

namespace hapticd::realtime {
namespace {

constexpr int kReservedCasts = 32;         // per tick, reserved for finding the constraints at the end
constexpr double kUnloaded = 0.5;          // of the bound: a slide that bears less has ended
constexpr double kPause_s = 0.2;           // a slide that pauses longer has ended: static friction returns
constexpr double kSpeedMemory_s = 0.02;    // over which the speed of a slide is averaged
constexpr double kAtRest = 1e-3;           // share of the skin
constexpr double kBallConvergence = 1e-8;  // share of the tool radius, in distance to the target

// Depths of the HIP below the faces themselves, without the skin that keeps the proxy off them. False when
// the proxy is jammed between faces that leave it no room and so does not lie on all of them; the depths are
// then scaled to the length of the spring at most.
bool depthsOf(const ObjectHit* hits, int count, double toolRadius_m, const Vec3& spring, const Vec3& hip,
              double* depths) {
  std::array<HalfSpace, kMaxActive> halfSpaces;
  for (int i = 0; i < count; ++i) {
    halfSpaces[static_cast<std::size_t>(i)] = hits[i].halfSpace;
    halfSpaces[static_cast<std::size_t>(i)].standoff = std::min(toolRadius_m, hits[i].halfSpace.standoff);
  }
  const bool room = depthsBelow(halfSpaces.data(), count, hip, depths);
  Vec3 normal = Vec3::Zero();
  for (int i = 0; i < count; ++i) normal += depths[i] * hits[i].halfSpace.normal;
  if (normal.squaredNorm() <= spring.squaredNorm()) return room;
  for (int i = 0; i < count; ++i) depths[i] *= spring.norm() / normal.norm();
  return false;
}

// Along a surface without friction it may go as fast as it likes.
bool creeps(const Vec3& velocity_m_per_s, const ContactConstraint& constraint) {
  constexpr double kCreep_m_per_s = 2e-3;
  const double speed = constraint.surface.staticFriction > 0
                           ? velocity_m_per_s.norm()
                           : std::abs(velocity_m_per_s.dot(constraint.halfSpace.normal));
  return speed <= kCreep_m_per_s;
}

}  // namespace

const ContactSet& Proxy::follow(const SceneAtTime& now, const Vec3& hip, const Vec3& hipVelocity_m_per_s,
                                double period_s, std::uint32_t& status) noexcept {
  now_ = now;
  hipVelocity_m_per_s_ = hipVelocity_m_per_s;
  period_s_ = period_s;
  casts_ = 0;
  search_.visits = 0;
  if (!started_) startAt(now, hip);
  planes_.place(*now.scene, now.time, hip, toolRadius_, query_.radius(), viewMoved());
  query_.beginTick(now, before_, position_, &planes_);
  const bool wasFree = contactSet_.count == 0;
  const BlendedSpring springBefore = contactSet_.spring;
  commandChanged_ = contactChangedByCommand();
  const Vec3 from = position_;
  carry(hip, status);
  expectedTravel_m_ = (hip - hipBefore_).norm() + (position_ - from).norm();
  push(from, status);
  leaveOutWhatSwallowed(from);
  wasHeld_ = contactSet_.count > 0;
  if (contactSet_.count > 0) {
    const double carried = (position_ - from).norm();
    query_.gatherAhead(position_, expectedWay(hip), 1.5 * carried + kGatherMargin_m);
  }
  updateProxy(hip);
  popThrough(hip, status);
  if (!wasFree && neighboursChangedByCommand(springBefore)) status |= kRenderGeometryJump;
  releaseWhenDeep(wasFree, status);
  if (returnFromJump(hip)) status |= kRenderGeometryJump;
  if (forceShading_) applyForceShading();
  unsigned touched = 0;
  for (int i = 0; i < contactSet_.count; ++i) {
    const int source = contactSet_.constraints[static_cast<std::size_t>(i)].source;
    if (source < 0) touched |= 1U << (-1 - source);
  }
  planes_.remember(touched, position_);
  if (casts_ >= kMaxCasts) status |= kRenderIterationLimit;
  if (query_.overflowed() || !contactSet_.spring.complete) status |= kRenderCandidateLimit;
  if (query_.isEnclosed() || planes_.leavesOut()) status |= kRenderEnclosed;
  fadeWhenOverworked(status);
  rememberConstraints();
  before_ = now;
  positionBefore_ = position_;
  hipBefore_ = hip;
  return contactSet_;
}

// The way of the HIP; along a way, without what leads into the faces that hold a ball.
Vec3 Proxy::expectedWay(const Vec3& hip) const noexcept {
  Vec3 way = hip - hipBefore_;
  if (query_.gathersBalls()) return way;
  for (int i = 0; i < contactSet_.count; ++i) {
    const Vec3& normal = contactSet_.constraints[static_cast<std::size_t>(i)].halfSpace.normal;
    way -= std::min(0.0, normal.dot(way)) * normal;
  }
  return way;
}

void Proxy::reset() noexcept {
  started_ = false;
  planes_.restart();
}

void Proxy::startAt(const SceneAtTime& now, const Vec3& hip) noexcept {
  started_ = true;
  position_ = positionBefore_ = hipBefore_ = hip;
  beFree();
  query_.restart();
  before_ = now;
}

// A free proxy may be a share of the skin away from the HIP: shorter ways are not worth a cast.
void Proxy::resume(const Vec3& position) noexcept {
  position_ = positionBefore_ = reported_ = position;
  beFree();
  query_.leaveAll();
}

void Proxy::beFree() noexcept {
  slide_ = Slide{};
  search_ = Search{};
  popthroughArmed_ = true;
  released_ = carriedByJump_ = false;
  jumper_ = -1;
  overworked_ = 0;
  share_ = 1;
  contactSet_ = ContactSet{};
  lastCount_ = 0;
  touchedObject_ = -1;
}

bool Proxy::frictionless() const noexcept {
  for (int i = 0; i < query_.objectCount(); ++i) {
    if (query_.object(i).state->surface.staticFriction > 0) return false;
  }
  for (const PlacedPlane& plane : planes_) {
    if (plane.surface.staticFriction > 0 || plane.state->adhesionLateral_N > 0) return false;
  }
  return true;
}

// The friction bound as a length of the spring: each contact bears mu_i N_i, however the normals point.
double Proxy::frictionConeOf(const ContactSet& contactSet) noexcept {
  const double stiffness = contactSet.spring.stiffness_N_per_m;
  if (!(stiffness > 0) || !(contactSet.normal_m.norm() > 0)) return 0;
  double cone = 0;
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[static_cast<std::size_t>(i)];
    cone += contactSet.boundOf(constraint);
  }
  return cone;
}

// Stribeck: the coefficient falls from the static to the dynamic one with the speed of the slide. Without
// the curve it falls at once.
double Proxy::slidingShare() const noexcept {
  if (!slide_.active) return 1;
  if (!(stribeckSpeed_m_per_s_ > 0)) return 0;
  const double ratio = slide_.speed_m_per_s / stribeckSpeed_m_per_s_;
  return std::exp(-ratio * ratio);
}

// In metres and seconds, so that a slow slide does not depend on the rate of the servo.
void Proxy::advanceSlide(double slip_m) noexcept {
  const bool slipped = slip_m > query_.minSkin();  // less is rounding
  slide_.active = slide_.active || slipped;
  slide_.pause_s = slipped ? 0 : slide_.pause_s + period_s_;
  if (slide_.pause_s >= kPause_s) slide_.active = false;
  const double forgotten = -std::expm1(-period_s_ / kSpeedMemory_s);
  slide_.speed_m_per_s =
      slide_.active ? slide_.speed_m_per_s + forgotten * (slip_m / period_s_ - slide_.speed_m_per_s) : 0;
  contactSet_.sliding = slide_.active;
}

// The proxy sticks while friction bears the lateral part; otherwise it slides until friction bears what is
// left. The slope of the stiffness pushes the proxy, too: what it holds, friction need not.
void Proxy::updateProxy(const Vec3& hip) noexcept {
  ActiveSet active;
  if (frictionless()) return updateWithoutFriction(hip, active);
  const bool displaced = wasHeld_ && (position_ != positionBefore_ || surfacesInContactMove());
  findConstraints(hip, active);
  if (liftOut(active)) findConstraints(hip, active);
  if (displaced) pressBack(hip, active);
  if (contactSet_.count == 0) {
    slide_ = Slide{};
    return;
  }
  if (displaced && slideInMovingGroove(hip, active)) return;
  // Friction of what is near, and not touched or not pressed, holds nothing.
  contactSet_.staticShare = 1;  // also where the dynamic coefficient is 0
  if (frictionConeOf(contactSet_) == 0) return updateWithoutFriction(hip, active);
  const Vec3 held = heldBySlope();
  const Vec3 borne = contactSet_.lateral_m - held;
  const double lateral = borne.norm();
  contactSet_.staticShare = slidingShare();
  if (borne.dot(slide_.direction) < kUnloaded * frictionConeOf(contactSet_)) slide_.active = false;
  contactSet_.staticShare = slidingShare();
  if (lateral <= frictionConeOf(contactSet_)) {
    advanceSlide(0);
    contactSet_.staticShare = slidingShare();
    return;
  }
  slide_.direction = borne / lateral;
  const Vec3 start = position_;
  const bool wasSliding = std::exchange(slide_.active, true);
  contactSet_.staticShare = slidingShare();
  slide_.active = wasSliding;
  slideTo(hip + held + slide_.direction * frictionConeOf(contactSet_), hip, active);
  // It ends at an edge, beyond which another face may hold the proxy.
  if (frictionConeOf(contactSet_) == 0) return updateWithoutFriction(hip, active);
  advanceSlide((position_ - start).norm());
  contactSet_.staticShare = slidingShare();
}

// Where the stiffness changes, the slope at the new place may be another one, and push the proxy back in the
// next tick, and so on. A slide must not fill the spring: where it does, it goes a share of its way, that of
// the last ticks, or not at all. Where a move takes much of the work of a tick, there is one only. A spring
// that pulls by more than the slopes before and after is not driven by them: the proxy goes where it pulls.
// Otherwise a wall that it meets there would not hold the hand, and nothing would bear that part of the
// spring.
void Proxy::slideTo(const Vec3& target, const Vec3& hip, ActiveSet& active) noexcept {
  constexpr double kShortest = 1.0 / 32;
  const auto spares = [this] { return casts_ < kMaxCasts / 4 && query_.visits() < kMaxVisits / 8; };
  const Vec3 start = position_;
  const double stored_J = storedInSpring();
  const double slope_N = contactSet_.spring.slope_N.norm();
  const bool even = slope_N == 0;
  const Vec3 back = hip + contactSet_.lateral_m - target;
  const double driving_N = contactSet_.spring.stiffness_N_per_m * back.norm();
  const auto goes = [&](double share) {
    position_ = start;
    moveFrictionless(target + (1 - share) * back, active);
    findConstraints(hip, active);
    const double newSlope_N = contactSet_.spring.slope_N.norm();
    return (even && newSlope_N == 0) || storedInSpring() <= stored_J || driving_N > slope_N + newSlope_N;
  };
  if (goes(1) || !spares()) return;
  if (goes(slide_.share)) {
    slide_.share = std::min(0.5, 2 * slide_.share);
    return;
  }
  slide_.share = std::max(kShortest, 0.25 * slide_.share);
  // The way back takes no move: two tries may leave too little for a third one, and enough for this.
  if (casts_ >= kMaxCasts / 2 || query_.visits() >= kMaxVisits / 2) return;
  position_ = start;
  findConstraints(hip, active);
}

double Proxy::storedInSpring() const noexcept {
  return 0.5 * contactSet_.spring.kappa_N_per_m *
         (contactSet_.normal_m + contactSet_.lateral_m).squaredNorm();
}

void Proxy::updateWithoutFriction(const Vec3& hip, ActiveSet& active) noexcept {
  const bool turned = moveFrictionless(hip, active);
  // The casts ended on the way, perhaps before any found a face at the place where the proxy is now.
  if (casts_ >= kMaxCasts && !turned) {
    Vec3 goal;
    active.count = 0;
    approach(hip, true, active, goal);
  }
  if (active.count == 0) restoreConstraints(hip, active);
  updateContactSet(hip, position_, active);
  slide_ = Slide{};
}

// Moves as near to the target as the surfaces allow. Each approach starts with an empty active set, so that
// only faces that block the path hold the proxy; the move ends when an approach brings it no nearer.
//
// A face that overlaps a squeezed ball moves it out, away from the target, and its way back may lead into the
// same face: round and round until the casts are spent. Then the proxy rests at the nearest place from which
// no approach came nearer, held by the faces that it met there, and not where the last cast happened to end.
// True when it does.
bool Proxy::moveFrictionless(const Vec3& target, ActiveSet& active) noexcept {
  const double skin = query_.minSkin();
  // A point comes to rest on planes after finitely many approaches; a ball on edges and corners only
  // converges.
  const double gain = std::max(1e-4 * skin, kBallConvergence * toolRadius_);
  // Allows for a proxy within the skin, which the first approach moves outwards.
  double nearest = (position_ - target).norm() + 4 * skin;
  Vec3 step = Vec3::Zero();
  bool first = true;
  bool escaped = false;      // the last step was out of a corner
  Vec3 turn = Vec3::Zero();  // the nearest place from which no approach came nearer
  std::optional<ActiveSet> turnHeld;
  double turnDistance = 0;
  bool climbed = false;  // away from it
  while (casts_ < kMaxCasts && !query_.workSpent()) {
    const Vec3 from = position_;
    std::optional<ActiveSet> held;
    if (!step.isZero(0)) {
      held = active;
      extrapolateStep(step, target, active);
    }
    active.count = 0;
    Vec3 goal;
    if (approach(target, false, active, goal)) return false;
    double distance = (position_ - target).norm();
    // Out of a face that moved or deformed into it: the place before was nearer, and not free. Among faces at
    // rest it is a jam, in which more approaches would only spend the work of the tick.
    if (std::exchange(first, false) && distance > nearest && !query_.allAtRest())
      nearest = std::numeric_limits<double>::infinity();
    // Where it did not move, the next approach would be the same.
    if (!(distance < nearest - gain) || (position_ - from).norm() <= kAtRest * skin) {
      if (held) {
        position_ = from;
        active = *held;
        step.setZero();
        if (!escaped && (!turnHeld || nearest < turnDistance)) {
          turn = from;
          turnHeld = active;
          turnDistance = nearest;
        }
        continue;
      }
      if (active.count < 2 || !escapeCorner(target, active)) break;
      distance = (position_ - target).norm();
      escaped = true;
      climbed = climbed || (turnHeld && distance > turnDistance);
    } else {
      escaped = false;
    }
    nearest = distance;
    if (toolRadius_ > 0) step = position_ - from;
  }
  if (casts_ < kMaxCasts || !climbed) return false;
  position_ = turn;
  active = *turnHeld;
  return true;
}

// Finds the constraints at the proxy; moves it only while there is none.
void Proxy::findConstraints(const Vec3& hip, ActiveSet& active) noexcept {
  active.count = 0;
  Vec3 goal = hip;
  approach(hip, true, active, goal);
  if (active.count == 0 && restoreConstraints(hip, active)) goal = nearestTo(hip, active).point;
  updateContactSet(hip, goal, active);
}

Projection Proxy::nearestTo(const Vec3& target, const ActiveSet& active) const noexcept {
  std::array<HalfSpace, kMaxHalfSpaces> halfSpaces;
  for (int i = 0; i < active.count; ++i) {
    halfSpaces[static_cast<std::size_t>(i)] = active.hits[static_cast<std::size_t>(i)].halfSpace;
  }
  return projectOntoActiveSet(halfSpaces.data(), active.count, target, position_, query_.minSkin() / 16);
}

// The work or the casts of a tick may be spent before the faces that hold the proxy are found again, or on
// its way to others, or among many objects it stops on that way. Those of the last tick hold it then, no
// farther than the proxy is from the HIP: the force fades out (fadeWhenOverworked) and does not end for a
// tick.
bool Proxy::restoreConstraints(const Vec3& hip, ActiveSet& active) const noexcept {
  if (!query_.workSpent() && casts_ < kMaxCasts && !query_.limitsTravel()) return false;
  for (int i = 0; i < lastCount_; ++i) {
    const LastConstraint& last = lastConstraints_[static_cast<std::size_t>(i)];
    const HalfSpace& face = last.halfSpace;
    if (face.normal.dot(hip - face.anchor) >= std::min(toolRadius_, face.standoff)) continue;
    for (int k = 0; k < query_.objectCount(); ++k) {
      const PlacedObject& object = query_.object(k);
      if (object.state->id != last.object || !object.rests()) continue;
      ObjectHit& hit = active.hits[static_cast<std::size_t>(active.count++)];
      hit = ObjectHit{};
      hit.object = k;
      hit.triangle = last.triangle;
      hit.halfSpace = face;
    }
  }
  return active.count > 0;
}

void Proxy::rememberConstraints() noexcept {
  lastCount_ = contactSet_.count;
  for (int i = 0; i < lastCount_; ++i) {
    const ContactConstraint& c = contactSet_.constraints[static_cast<std::size_t>(i)];
    lastConstraints_[static_cast<std::size_t>(i)] = {c.object, c.triangle, c.halfSpace};
  }
}

// One approach: collects half-spaces on the path. `goal` becomes the point nearest to the target above them.
// With `stopAtFirst` the proxy stays at the first one. True when the proxy reached the target and the set is
// empty.
bool Proxy::approach(const Vec3& target, bool stopAtFirst, ActiveSet& active, Vec3& goal) noexcept {
  const double skin = query_.minSkin();
  const int limit = stopAtFirst ? kMaxCasts + kReservedCasts : kMaxCasts;
  // A face that the tool overlaps moves it out, by its own way in at most. Faces that leave it no room would
  // move it far: their planes may meet anywhere.
  const double farthest = (position_ - target).norm() + 2 * query_.radius() + 4 * skin;
  jammed_ = false;
  while (casts_ < limit) {
    Projection nearest = nearestTo(target, active);
    if (!nearest.found || (nearest.point - target).norm() > farthest) {
      jammed_ = true;
      // A ball that came from behind overlaps faces by as much as its radius.
      if (toolRadius_ == 0) acceptOverlaps(active);
      nearest = toolRadius_ == 0 ? nearestTo(target, active) : Projection{};
    }
    goal = nearest.found ? nearest.point : position_;
    if (!nearest.found) break;
    active.keep(nearest);
    Vec3 end = goal;
    const bool shortened = query_.shorten(position_, end);
    const Vec3 displacement = end - position_;
    if (displacement.norm() <= 1e-3 * skin) return active.count == 0 || shortened;
    ++casts_;
    ObjectHit hit;
    // Further constraints are at the proxy: the start of the path is enough.
    const bool held = stopAtFirst && active.count > 0;
    if (!(held ? query_.castWithinGathered(position_, end, hit) : query_.cast(position_, end, hit))) {
      if (held) return false;
      position_ = end;
      return active.count == 0 || shortened;
    }
    if (hit.unexamined) {
      if (!stopAtFirst) position_ += hit.stop * displacement;
      return false;
    }
    const double move = hit.stop * displacement.norm();
    if (held && move > skin) return false;
    if (!stopAtFirst || move > skin) position_ += hit.stop * displacement;
    if (!query_.isGathered(position_)) {
      query_.ensureGathered(position_,
                            std::min(1.5 * expectedTravel_m_ + kGatherMargin_m, query_.roomyReach()));
    }
    active.hits[static_cast<std::size_t>(active.count++)] = hit;
  }
  // No solution for all of them: keep the set before the newest one.
  active.count = std::clamp(active.count - 1, std::min(active.count, 1), kMaxActive);
  return false;
}

// Out of faces that overlap the tool: they deformed while friction held it, or it popped through others. True
// when it moved.
bool Proxy::liftOut(const ActiveSet& active) noexcept {
  const auto overlaps = [&](const ObjectHit& hit) {
    return hit.halfSpace.height(position_) < -4 * std::max(query_.minSkin(), query_.maxSkin());
  };
  if (std::none_of(active.hits.begin(), active.hits.begin() + active.count, overlaps)) return false;
  const Vec3 way = nearestTo(position_, active).point - position_;
  if (!(way.norm() <= 2 * query_.radius())) return false;
  ObjectHit hit;
  ++casts_;
  position_ += (query_.cast(position_, position_ + way, hit) ? hit.stop : 1.0) * way;
  return true;
}

// Faces that leave the tool no room hold it no deeper than it is, so that it still slides along them.
void Proxy::acceptOverlaps(ActiveSet& active) const noexcept {
  constexpr double kRise = 0.25;  // of the skin, so that rounding does not make a way along them lead inwards
  for (int i = 0; i < active.count; ++i) {
    HalfSpace& face = active.hits[static_cast<std::size_t>(i)].halfSpace;
    face.standoff += std::min(0.0, face.height(position_) + kRise * query_.minSkin());
  }
}

void Proxy::updateContactSet(const Vec3& hip, const Vec3& goal, const ActiveSet& active) noexcept {
  contactSet_ = ContactSet{};
  const int count = std::min(active.count, kMaxActive);
  std::array<double, kMaxActive> depths{};
  const bool onAll = depthsOf(active.hits.data(), count, toolRadius_, position_ - hip, hip, depths.data());
  double hardest = -1;
  // The proxy keeps a distance from faces, so that one may hold it that the HIP is not below.
  const bool below = std::any_of(depths.begin(), depths.end(), [](double depth) { return depth > 0; });
  for (int i = 0; i < count; ++i) {
    if (below && depths[static_cast<std::size_t>(i)] == 0) continue;
    const ObjectHit& hit = active.hits[static_cast<std::size_t>(i)];
    ContactConstraint& constraint = contactSet_.constraints[static_cast<std::size_t>(contactSet_.count++)];
    constraint.source = hit.object;
    constraint.triangle = hit.triangle;
    constraint.halfSpace = hit.halfSpace;
    constraint.forceDirection = hit.halfSpace.normal;
    constraint.depth_m = depths[static_cast<std::size_t>(i)];
    contactSet_.normal_m += constraint.depth_m * constraint.halfSpace.normal;
    if (hit.object < 0) {
      const PlacedPlane& plane = planes_[-1 - hit.object];
      constraint.surface = plane.surface;
      constraint.rests = plane.rests;
      constraint.carried_m = carriedByView(positionBefore_) - positionBefore_;
      constraint.creeps = plane.still && creeps(constraint.carried_m / period_s_, constraint);
      constraint.adhesion_N = plane.share * plane.state->adhesionLateral_N;
    } else {
      const PlacedObject& object = query_.object(hit.object);
      constraint.object = object.state->id;
      constraint.surface = object.state->surface;
      constraint.rests = object.rests();
      if (!object.jumped) {
        const Vec3 velocity =
            (carriedBy(object, hit.triangle, positionBefore_) - positionBefore_) / period_s_;
        constraint.carried_m = period_s_ * velocity;
        constraint.creeps = creeps(velocity, constraint);
        if (!viewMoved()) constraint.surfaceVelocity_m_per_s = velocity;
      }
    }
    const double force = constraint.surface.stiffness_N_per_m * constraint.depth_m;
    if (force > hardest) {
      hardest = force;
      touchedObject_ = constraint.object;
      touchedTriangle_ = constraint.triangle;
    }
  }
  reported_ = position_;
  if (count == 0) {
    popthroughArmed_ = true;
    search_.stage = search_.direction = 0;
    return;
  }
  if (onAll) contactSet_.lateral_m = position_ - goal;
  const bool arrived = casts_ < kMaxCasts && !query_.workSpent();
  const bool free = contactSet_.normal_m.isZero(0);  // then only the report is left to find
  if (toolRadius_ == 0 && onAll && (arrived || free)) reported_ = onFaces(hip, active);
  contactSet_.spring = blendedSpring(now_, query_, planes_, toolRadius_, reported_, contactSet_);
  findPressure();
}

// The proxy on the faces that hold it, at their skins so that rounding does not put it behind one of them.
// Another face may be in between: where the planes of two faces meet behind it, or where it moved.
Vec3 Proxy::onFaces(const Vec3& hip, const ActiveSet& active) noexcept {
  // Only the ball touches: the HIP itself is free.
  if (contactSet_.normal_m.isZero(0))
    return position_ + query_.freeOfFaces(position_, hip) * (hip - position_);
  // Where faces leave the tool no room, their planes may meet anywhere.
  if (jammed_) return position_;
  const int count = std::min(active.count, kMaxActive);
  std::array<double, kMaxActive> depths{};
  depthsOf(active.hits.data(), count, query_.minSkin(), position_ - hip, hip, depths.data());
  Vec3 place = hip + contactSet_.lateral_m;
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    place += depths[k] * active.hits[k].halfSpace.normal;
  }
  const auto overlaps = [&](const ObjectHit& h) {
    return h.halfSpace.height(position_) < -std::max(query_.maxSkin(), query_.minSkin());
  };
  if (std::any_of(active.hits.begin(), active.hits.begin() + count, overlaps)) return position_;
  // The same where they meet at a very acute angle: the faces may end before.
  const Vec3 way = place - position_;
  if (way.norm() > kLargestGapTolerance_m) place = position_ + kLargestGapTolerance_m * way.normalized();
  if (count > 1 && way.norm() > 2 * query_.radius()) place = onFacesThatGoOn(place, active);
  // Nothing that rests is nearer to the proxy than the one face that it touches.
  if (count == 1 && query_.allAtRest()) return place;
  // Beyond the face or the edge that touches the ball, a half-space goes on: where two meet may be past a
  // gap. The reported place stays where it is nearest to an edge, and passes no face nearer than the ball
  // does.
  const Vec3 closer = place - position_;
  double share = 1;
  for (int i = 0; i < count && count > 1; ++i) {
    const ObjectHit& h = active.hits[static_cast<std::size_t>(i)];
    const double nearest = (h.halfSpace.anchor - position_).dot(closer);
    if (h.atEdge) share = std::min(share, std::max(0.0, nearest / closer.squaredNorm()));
  }
  place = position_ + share * closer;
  return position_ + query_.freeOfFaces(position_, place, count > 1) * (place - position_);
}

// In an acute wedge, faces may end before their planes meet: between them is a gap that the ball does not
// pass. The nearest place on the way to `place` that all of them still reach.
Vec3 Proxy::onFacesThatGoOn(const Vec3& place, const ActiveSet& active) noexcept {
  constexpr double kOverhang = 0.25;  // share of the radius
  const Vec3 way = place - position_;
  if (!query_.ensureGathered(position_, way.norm())) return position_;
  const auto reached = [&](const Vec3& x) {
    unsigned holding = 0;
    query_.forEachGathered(x, query_.radius(), [&](const Facet& f) {
      const double height = f.normal.dot(x - f.a);
      const double distance2 = (nearestPointOf(f, x) - x).squaredNorm();
      const double overhang = kOverhang * f.radius;
      if (std::abs(height) > f.radius + 4 * f.skin || distance2 > height * height + overhang * overhang)
        return;
      const double side = f.normal.dot(position_ - f.a) < 0 && !f.unbounded ? -1 : 1;
      for (int i = 0; i < active.count; ++i) {
        if (side * f.normal.dot(active.hits[static_cast<std::size_t>(i)].halfSpace.normal) > 0.5)
          holding |= 1U << static_cast<unsigned>(i);
      }
    });
    for (int i = 0; i < active.count; ++i) {
      if (active.hits[static_cast<std::size_t>(i)].object < 0) holding |= 1U << static_cast<unsigned>(i);
    }
    return holding + 1 == 1U << static_cast<unsigned>(active.count);
  };
  if (reached(place)) return place;
  double share = 0;
  for (double step = 0.5; step > 1e-3; step *= 0.5) {
    if (reached(position_ + (share + step) * way)) share += step;
  }
  return position_ + share * way;
}

// Above the popthrough force, the proxy steps through the faces that give way and moves on to the HIP. Other
// surfaces stop it as ever: without room behind the face, it stays in front.
void Proxy::popThrough(const Vec3& hip, std::uint32_t& status) noexcept {
  if (!popthroughArmed_ || contactSet_.count == 0) return;
  const auto givesWay = [](const scene::Surface& surface, double depth) {
    return surface.popthrough_N > 0 && surface.stiffness_N_per_m * depth > surface.popthrough_N;
  };
  std::uint64_t passable = 0;
  for (int i = 0; i < query_.objectCount(); ++i) {
    if (givesWay(query_.object(i).state->surface, contactSet_.normal_m.norm()))
      passable |= std::uint64_t{1} << i;
  }
  bool pressed = false;
  Vec3 direction = Vec3::Zero();
  const auto holds = [&](const ContactConstraint& c) {
    return c.source < 0 || (passable >> static_cast<unsigned>(c.source) & 1U) == 0;
  };
  for (int i = 0; i < contactSet_.count; ++i) {
    const ContactConstraint& constraint = contactSet_.constraints[static_cast<std::size_t>(i)];
    if (holds(constraint)) continue;
    direction -= constraint.depth_m * constraint.halfSpace.normal;
    pressed = pressed || givesWay(constraint.surface, constraint.depth_m);
  }
  if (!pressed) return;
  for (int i = 0; i < contactSet_.count; ++i) {
    const ContactConstraint& constraint = contactSet_.constraints[static_cast<std::size_t>(i)];
    const Vec3& normal = constraint.halfSpace.normal;
    if (holds(constraint)) direction -= std::min(0.0, normal.dot(direction)) * normal;
  }
  direction.normalize();
  double step = 0;
  for (int i = 0; i < contactSet_.count; ++i) {
    const ContactConstraint& constraint = contactSet_.constraints[static_cast<std::size_t>(i)];
    const HalfSpace& face = constraint.halfSpace;
    const double fall = -face.normal.dot(direction);
    if (!holds(constraint) && fall > 0.1)
      step = std::max(step, (face.height(position_) + 2 * face.standoff) / fall);
  }
  if (step == 0) return;
  // A ball gets through once there is room for it behind the face: before, the face would push it on from
  // behind. Where what gives way leaves no room between its sides, the ball passes all of them at once.
  const double deepest = (hip - position_).dot(direction);
  if (deepest < step) return;
  if (!hasWay(passable, position_ + step * direction)) {
    step = deepest;
    if (!hasWay(passable, position_ + step * direction)) return;
  }
  wasHeld_ = false;
  position_ += step * direction;
  updateProxy(hip);
  status |= kRenderPopthrough;
  popthroughArmed_ = contactSet_.count == 0;
}

// Nothing else is in the way to `place`, and what is `passable` does not overlap the ball there.
bool Proxy::hasWay(std::uint64_t passable, const Vec3& place) noexcept {
  ObjectHit hit;
  ++casts_;
  if (query_.castPast(passable, position_, place, hit)) return false;
  if (!query_.ensureGathered(place, kGatherMargin_m)) return false;
  bool overlaps = false;
  query_.forEachGathered(place, query_.radius(), [&](const Facet& f) {
    if (overlaps || f.object < 0 || (passable >> static_cast<unsigned>(f.object) & 1U) == 0) return;
    overlaps = isTouchable(f, query_.faces(), place) && (nearestPointOf(f, place) - place).norm() < f.radius;
  });
  return !overlaps;
}

void Proxy::applyForceShading() noexcept {
  for (int i = 0; i < contactSet_.count; ++i) {
    ContactConstraint& constraint = contactSet_.constraints[static_cast<std::size_t>(i)];
    if (constraint.source < 0) continue;
    const Vec3 at = position_ - query_.radius() * constraint.halfSpace.normal;
    constraint.forceDirection = shadedNormal(query_.object(constraint.source), constraint.triangle, now_.time,
                                             constraint.halfSpace, at);
  }
}

// Where the work of every tick is spent, the proxy lags behind the hand and its force is not the surface's:
// after kMaxOverworked ticks in a row it fades out, and it returns when the HIP has left.
void Proxy::fadeWhenOverworked(std::uint32_t& status) noexcept {
  constexpr int kMaxOverworked = 20;
  constexpr double kFade_s = 0.050;
  if (query_.workSpent()) status |= kRenderWorkLimit;
  overworked_ = query_.workSpent() ? overworked_ + 1 : 0;
  if (contactSet_.count == 0 && !query_.workSpent()) share_ = 1;
  if (share_ < 1 || overworked_ > kMaxOverworked) share_ = std::max(0.0, share_ - period_s_ / kFade_s);
}

// A first contact this deep does not come from motion of the HIP, and a hand does not yield to an object that
// jumps.
void Proxy::releaseWhenDeep(bool wasFree, std::uint32_t& status) noexcept {
  if (contactSet_.count == 0) {
    released_ = false;
    return;
  }
  const double deepest = std::max(kJump_m, kFastestHip_m_per_s * std::min(period_s_, kLongestTick_s));
  if ((wasFree || carriedByJump_) && contactSet_.normal_m.norm() > deepest) released_ = true;
  if (released_) status |= kRenderReleased;
}

}  // namespace hapticd::realtime

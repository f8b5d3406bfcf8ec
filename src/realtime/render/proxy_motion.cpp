// How the proxy follows geometry that moves, deforms, disappears or appears.
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>
#include <utility>

#include "realtime/render/enclosure.h"
#include "realtime/render/proxy.h"
#include "realtime/render/renderer.h"
#include "realtime/render/stiffness_blend.h"

namespace hapticd::realtime {
namespace {

using geometry::Box;
using geometry::Mat3;

constexpr int kMaxPushes = 16;
constexpr double kThickness_m = 20e-6;  // faces of one object that are nearer to each other count as one

}  // namespace

// The pose that the object follows moves a part near the proxy farther than a motion does. Decided when the
// object meets the proxy, and only then: it depends on the snapshot and on this tick.
bool Proxy::isJump(const PlacedObject& object) const noexcept {
  const scene::Workspace& workspace = now_.scene->workspace;
  const double units = workspace.worldUnitsPerMetre;
  return object.state->motion.longestMoveNear(object.state->mesh->index.bounds(),
                                              workspace.T_world_device * position_,
                                              kNear_m * units) > kLongestMotion_m * units;
}

// The same for the shape that a mesh is taking, at the triangle that meets the proxy. The move is affine over
// it; where it is so large that its corners are far from the proxy, they do not count.
bool Proxy::isJump(const PlacedObject& object, std::uint32_t triangle) const noexcept {
  const scene::MeshGeometry& mesh = *object.state->mesh;
  if (!mesh.target || !mesh.before) return false;
  Mat3 corners;
  Mat3 moves;
  for (int i = 0; i < 3; ++i) {
    const std::uint32_t v = (*mesh.triangles)[triangle][static_cast<std::size_t>(i)];
    corners.col(i) = object.T_device_object * mesh.vertex(v, now_.time);
    moves.col(i) = object.T_device_object.linear() * ((*mesh.target)[v] - (*mesh.before)[v]).cast<double>();
  }
  if (moves.colwise().norm().maxCoeff() <= kLongestMotion_m) return false;
  const Vec3 b = corners.col(1) - corners.col(0);
  const Vec3 c = corners.col(2) - corners.col(0);
  Mat3 frame;
  frame << b, c, b.cross(c).normalized();
  Mat3 moveAlong;
  moveAlong << moves.col(1) - moves.col(0), moves.col(2) - moves.col(0), Vec3::Zero();
  const Mat3 gradient = moveAlong * frame.inverse();
  const Vec3 here = moves.col(0) + gradient * (position_ - corners.col(0));
  return !(here.norm() + kNear_m * gradient.norm() <= kLongestMotion_m);  // not a number: degenerate
}

bool Proxy::viewMoved() const noexcept {
  return now_.scene != before_.scene &&
         now_.scene->workspace.T_device_world.matrix() != before_.scene->workspace.T_device_world.matrix();
}

// Planes move with the view alone; one that jumps leaves them to the hand.
Vec3 Proxy::carriedByView(const Vec3& p) const noexcept {
  if (!viewMoved()) return p;
  const ViewMotion view{now_.scene->workspace.T_device_world, before_.scene->workspace.T_world_device};
  return view.jumpsAt(p) ? p : view.of(p);
}

// The hand did not cause such a change of the force.
bool Proxy::contactChangedByCommand() const noexcept {
  if (planes_.changed()) return true;
  if (now_.scene == before_.scene) return false;
  // A view may move into a hand that is free.
  if (viewMoved()) return true;
  if (contactSet_.count == 0) return false;
  const scene::SceneSnapshot& now = *now_.scene;
  const scene::SceneSnapshot& before = *before_.scene;
  if (now.faces != before.faces) return true;
  for (int i = 0; i < contactSet_.count; ++i) {
    const ContactConstraint& constraint = contactSet_.constraints[static_cast<std::size_t>(i)];
    if (constraint.object < 0) continue;
    const scene::ObjectState* const present = now.find(constraint.object);
    const scene::ObjectState* const past = before.find(constraint.object);
    if (present == past) continue;
    if (present == nullptr || past == nullptr || !(present->surface == past->surface) ||
        present->mesh->topology != past->mesh->topology || present->motion.jumps() != past->motion.jumps())
      return true;
  }
  return false;
}

// What is near takes part in the spring although it is not touched. The hand and motions change that
// gradually, a command at once.
bool Proxy::neighboursChangedByCommand(const BlendedSpring& before) const noexcept {
  constexpr double kStep_N = 0.1;
  if (contactSet_.count == 0 || (now_.scene == before_.scene && !query_.leftOutChanged())) return false;
  const BlendedSpring& now = contactSet_.spring;
  const double spring_m = (contactSet_.normal_m + contactSet_.lateral_m).norm();
  const bool steps = std::abs(now.stiffness_N_per_m - before.stiffness_N_per_m) * spring_m > kStep_N ||
                     (now.slope_N + now.turn_N - before.slope_N - before.turn_N).norm() > kStep_N;
  return steps && (query_.leftOutChanged() || surfacesNearChanged());
}

bool Proxy::surfacesNearChanged() const noexcept {
  const scene::SceneSnapshot& now = *now_.scene;
  const scene::SceneSnapshot& before = *before_.scene;
  const auto samePlane = [](const scene::Plane& a, const scene::Plane& b) {
    return a.surface == b.surface && a.placement == b.placement;
  };
  if (now.objects.size() != before.objects.size() ||
      !std::equal(now.planes.begin(), now.planes.end(), before.planes.begin(), before.planes.end(),
                  samePlane))
    return true;
  // Of all objects, because what the query has found near depends on the boxes of the index. Those that stay
  // are the same in both scenes.
  const double reach = 2 * blendReach(toolRadius_, contactSet_);  // was wider when the spring was longer
  const auto isNear = [&](const SceneAtTime& at, const scene::ObjectState& object) {
    const Affine T_device_object = at.scene->workspace.T_device_world * object.motion.at(at.time);
    const Box& box = object.mesh->indexAt(at.time).bounds();
    return !scene::partNear(box, std::span(&T_device_object, 1), position_, reach).empty();
  };
  for (std::size_t i = 0; i < now.objects.size(); ++i) {
    const scene::ObjectState& present = *now.objects[i];
    const scene::ObjectState& past = *before.objects[i];
    if (&present == &past) continue;
    if (present.id != past.id) return true;
    const bool same = past.surface == present.surface && past.mesh->topology == present.mesh->topology &&
                      past.motion.jumps() == present.motion.jumps();
    if (!same && (isNear(now_, present) || isNear(before_, past))) return true;
  }
  return false;
}

bool Proxy::surfacesInContactMove() const noexcept {
  const bool planesRest =
      std::all_of(planes_.begin(), planes_.end(), [](const PlacedPlane& plane) { return plane.rests; });
  if (planesRest && query_.allAtRest()) return false;
  const auto moves = [&](const ContactConstraint& c) {
    if (c.object < 0) return !planesRest;
    for (int i = 0; i < query_.objectCount(); ++i) {
      if (query_.object(i).state->id == c.object) return !query_.object(i).rests();
    }
    return true;
  };
  return std::any_of(contactSet_.constraints.begin(), contactSet_.constraints.begin() + contactSet_.count,
                     moves);
}

// Of several surfaces, the one whose friction holds the proxy most firmly carries it, and the one
// without friction does not. Where one of the two jumps, the hardest pressed one carries it.
void Proxy::chooseCarrier() noexcept {
  const auto end = contactSet_.constraints.begin() + contactSet_.count;
  if (contactSet_.count < 2 || !(contactSet_.spring.stiffness_N_per_m > 0)) return;
  const auto firmest = std::max_element(contactSet_.constraints.begin(), end,
                                        [this](const ContactConstraint& a, const ContactConstraint& b) {
                                          return contactSet_.boundOf(a) < contactSet_.boundOf(b);
                                        });
  if (!(contactSet_.boundOf(*firmest) > 0) || firmest->object == touchedObject_) return;
  if (jumps(touchedObject_, touchedTriangle_) || jumps(firmest->object, firmest->triangle)) return;
  touchedObject_ = firmest->object;
  touchedTriangle_ = firmest->triangle;
}

bool Proxy::jumps(std::int32_t id, std::uint32_t triangle) noexcept {
  if (id < 0) return false;
  const int i = query_.addObject(id);
  if (i < 0) return true;
  const PlacedObject& object = query_.object(i);
  return object.jumped || (object.moved && isJump(object)) || (object.deformed && isJump(object, triangle));
}

// A placement that turns or mirrors an object takes the touched face to its other side: the proxy would go
// with it, and the force would turn round.
bool Proxy::turnsAway(const PlacedObject& object) const noexcept {
  constexpr double kTurned = 0.5;  // cosine
  if (object.before == nullptr) return false;
  const Mat3 change = object.T_device_object.linear() * object.T_device_objectBefore.linear().inverse();
  for (int i = 0; i < contactSet_.count; ++i) {
    const ContactConstraint& constraint = contactSet_.constraints[static_cast<std::size_t>(i)];
    if (constraint.object != object.state->id || constraint.triangle != touchedTriangle_) continue;
    const Vec3& normal = constraint.halfSpace.normal;
    return !((change.inverse().transpose() * normal).normalized().dot(normal) > kTurned);
  }
  return false;
}

// The proxy stays at its place on the touched object, however that moved or deformed.
void Proxy::carry(const Vec3& hip, std::uint32_t& status) noexcept {
  carriedByJump_ = false;
  if (contactSet_.count > 0) {
    chooseCarrier();
    const int touched = query_.addObject(touchedObject_);
    if (touchedObject_ < 0) {
      position_ = carriedByView(position_);
    } else if (touched < 0) {
      status |= kRenderGeometryJump;
    } else {
      const PlacedObject& object = query_.object(touched);
      const Vec3 carried = carriedBy(object, touchedTriangle_, position_);
      const bool deformedFar = object.deformed && isJump(object, touchedTriangle_);
      carriedByJump_ = object.jumped || (carried != position_ && (isJump(object) || deformedFar));
      if (carriedByJump_) status |= kRenderGeometryJump;
      if (carriedByJump_) takenByJump(object);
      if (!object.jumped || ((carried - position_).norm() <= kJump_m && !turnsAway(object))) {
        position_ = carried;
      } else {
        status |= kRenderGeometryJump;
        position_ = hip;
        contactSet_ = ContactSet{};
      }
    }
  }
  const bool changed = contactSet_.count > 0 && now_.scene != before_.scene;
  if (changed) addTouchedWithNewTriangles();
  query_.addObjectsNear(hip, reachAround(hip) + kGatherMargin_m, position_);
  if (changed && liftOutOfNewTriangles()) {
    status |= kRenderGeometryJump;
    query_.addObjectsNear(hip, reachAround(hip) + kGatherMargin_m, position_);
  }
  query_.leaveOutEnclosing(position_);
}

// The proxy stays within this distance of the HIP during the tick, as seen from all objects: a workspace that
// moves takes it past them.
double Proxy::reachAround(const Vec3& hip) const noexcept {
  const double reach = std::max((position_ - hip).norm(), (positionBefore_ - hip).norm());
  if (now_.scene == before_.scene) return reach;
  const Affine& T_device_world = now_.scene->workspace.T_device_world;
  const scene::Workspace& before = before_.scene->workspace;
  if (T_device_world.matrix() == before.T_device_world.matrix()) return reach;
  const double moved = (T_device_world * (before.T_world_device * positionBefore_) - hip).norm();
  return moved <= reach + kLongestMotion_m ? std::max(reach, moved) : reach;
}

// In a crowd, new triangles count as those of an object that appeared. Here they are known to be touched.
void Proxy::addTouchedWithNewTriangles() noexcept {
  for (int i = 0; i < contactSet_.count; ++i) {
    const std::int32_t id = contactSet_.constraints[static_cast<std::size_t>(i)].object;
    const scene::ObjectState* const present = now_.scene->find(id);
    const scene::ObjectState* const past = before_.scene->find(id);
    if (present != nullptr && past != nullptr && present->mesh->topology != past->mesh->topology)
      query_.addObject(id);
  }
}

// New triangles may rise a little above a proxy that was outside, also those beside the touched ones, and
// those of an object in the place of another one. True when it moved.
bool Proxy::liftOutOfNewTriangles() noexcept {
  std::uint64_t changed = 0;
  for (int i = 0; i < query_.objectCount(); ++i) {
    const PlacedObject& object = query_.object(i);
    const bool appeared = object.before == nullptr;
    if (!appeared && !object.jumped) continue;
    const bool inPlace = !appeared && object.before->motion.jumps() == object.state->motion.jumps();
    if (!pressOf(object).isZero(0) || (inPlace && !query_.isLeftOut(object.state->id)))
      changed |= std::uint64_t{1} << i;
  }
  EnclosureBudget budget;
  bool lifted = false;
  for (int i = 0; changed >> i != 0 && i < query_.objectCount(); ++i) {
    if ((changed >> i & 1U) != 0) lifted = liftOutOf(i, changed, budget) || lifted;
  }
  return lifted;
}

// The direction in which an object pressed the tool, weighted by depths. One that appears takes the place of
// those that vanish.
Vec3 Proxy::pressOf(const PlacedObject& object) const noexcept {
  Vec3 press = Vec3::Zero();
  for (int i = 0; i < contactSet_.count; ++i) {
    const ContactConstraint& constraint = contactSet_.constraints[static_cast<std::size_t>(i)];
    const bool replaced =
        object.before == nullptr && constraint.object >= 0 && now_.scene->find(constraint.object) == nullptr;
    if (constraint.object == object.state->id || replaced)
      press += constraint.depth_m * constraint.halfSpace.normal;
  }
  return press;
}

// As far as needed: friction of others would keep the proxy where it is lifted to. In short steps, so that of
// several layers the next one holds it.
bool Proxy::liftOutOf(int i, std::uint64_t changed, EnclosureBudget& budget) noexcept {
  const PlacedObject& object = query_.object(i);
  const Vec3 press = pressOf(object);
  const Vec3 out = (press.isZero(0) ? contactSet_.normal_m : press).normalized();
  for (const double lift_m : {0.5e-3, 1e-3, 1.5e-3, 2e-3}) {
    if (liftOutOf(i, changed, lift_m * out, !press.isZero(0), budget)) return true;
  }
  return false;
}

// What did not change stops it.
bool Proxy::liftOutOf(int i, std::uint64_t changed, const Vec3& way, bool pressed,
                      EnclosureBudget& budget) noexcept {
  const PlacedObject& object = query_.object(i);
  Vec3 lifted = position_ + way;
  ObjectHit hit;
  const bool inside = encloses(object, query_.faces(), now_.time, position_, toolRadius_, budget) &&
                      !encloses(object, query_.faces(), now_.time, lifted, toolRadius_, budget);
  if (!inside && (!pressed || !isBelowOpen(i, way.normalized(), lifted))) return false;
  if (query_.castPast(changed, position_, lifted, hit)) return false;
  position_ = lowestLayer(i, lifted);
  return true;
}

// On the way back down to the proxy. A ball fits between no layers that are so near.
Vec3 Proxy::lowestLayer(int i, const Vec3& lifted) noexcept {
  constexpr int kMost = 4;
  const Vec3 down = (position_ - lifted).normalized();
  Vec3 place = lifted;
  Vec3 from = lifted;
  ObjectHit hit;
  for (int layer = 0; layer < kMost && query_.castAtObject(i, from, position_, hit); ++layer) {
    place = from + hit.stop * (position_ - from);
    from = place + kThickness_m * down;
    if (toolRadius_ > 0 || down.dot(position_ - from) <= 0) break;
  }
  return place;
}

// An open surface is around nothing. Where it held the point and nothing of it does so now, but something of
// it that looks the same way is above, it rose. `lifted` moves nearer when another face of it is between. A
// ball overlaps what rose, and needs no lift.
bool Proxy::isBelowOpen(int i, const Vec3& out, Vec3& lifted) noexcept {
  if (toolRadius_ > 0) return false;
  const Vec3 up = lifted - position_;
  ObjectHit hit;
  if (query_.castAtObject(i, position_, position_ - up, hit)) return false;
  if (query_.castAtObject(i, position_, lifted, hit))
    lifted = position_ + std::min(1.0, hit.stop + kThickness_m / up.norm()) * up;
  return query_.castAtObject(i, lifted, position_, hit) && !hit.unexamined &&
         hit.halfSpace.normal.dot(out) > 0;
}

Vec3 Proxy::carriedBy(const PlacedObject& object, std::uint32_t triangle, const Vec3& p) const noexcept {
  if (object.before == nullptr) return p;
  Facet then;
  Facet now;
  if (!object.deformed || !makeFacet(object.cornersBefore(triangle, before_.time), 0, then) ||
      !makeFacet(object.corners(triangle, now_.time), 0, now)) {
    return object.carried(p);
  }
  // makeFacet() reorders the corners by the longest edge, which may differ between ticks: use the original
  // order.
  const scene::Corners t = object.cornersBefore(triangle, before_.time);
  const scene::Corners n = object.corners(triangle, now_.time);
  Mat3 frame;
  frame << t.b - t.a, t.c - t.a, then.normal;
  const Vec3 local = frame.inverse() * (p - t.a);
  return n.a + local.x() * (n.b - n.a) + local.y() * (n.c - n.a) + local.z() * now.normal;
}

// Geometry that passed over the proxy takes it along. Where it leaves a ball no room, the ball overlaps it,
// and its centre is pushed as a point is, so that it gets behind none.
void Proxy::push(const Vec3& from, std::uint32_t& status) noexcept {
  const Vec3 carried = position_;
  const double travel = expectedTravel_m_;
  missed_ = 0;
  gatherSweeps(from);
  if (pushUntilFree(from, status)) {
    if (query_.workSpent()) holdPlanesBack();
    return;
  }
  if (toolRadius_ > 0.5 * kGapTolerance_m) {
    position_ = carried;
    expectedTravel_m_ = travel;
    query_.castPointTool(true);
    pushUntilFree(from, status);
    query_.castPointTool(false);
  }
  holdPlanesBack();
}

// Faces that were not examined push nothing. A body that got around the proxy with them would hold the hand
// inside.
void Proxy::leaveOutWhatSwallowed(const Vec3& from) noexcept {
  EnclosureBudget budget;
  for (int i = query_.objectCount() - 1; missed_ != 0 && i >= 0; --i) {
    if ((missed_ >> i & 1U) == 0) continue;
    const PlacedObject& object = query_.object(i);
    if (!encloses(object, query_.faces(), now_.time, position_, 0, budget)) continue;
    const bool known = budget.visits > 0;
    if (known && encloses(object, query_.faces(), before_.time, object.carried(from), 0, budget)) continue;
    query_.leaveOut(i);
  }
}

// The way on which one face pushes the proxy is a way relative to all others, so this goes on until no face
// passes the proxy any more. False where they leave it no room.
bool Proxy::pushUntilFree(const Vec3& from, std::uint32_t& status) noexcept {
  Pushers pushers;
  for (int k = 0; k < kMaxPushes && !pushers.jammed; ++k) {
    pushers.circling = k >= kMaxPushes / 4;
    bool pushed = pushByObjects(from, pushers, status);
    pushed = (!pushers.jammed && pushByDeformingFaces(from, pushers, status)) || pushed;
    pushed = (!pushers.jammed && pushByPlanes(pushers)) || pushed;
    if (!pushed) return true;
  }
  return false;
}

void Proxy::Pushers::add(const HalfSpace& face) noexcept {
  const auto end = faces.begin() + count;
  const auto known = std::find_if(faces.begin(), end, [&](const HalfSpace& f) {
    return circling && f.normal == face.normal && f.anchor == face.anchor;
  });
  if (known == end) ++count;
  *known = face;
}

// At most three hold the proxy; the others push again if it meets them. Where they do so in turn without end,
// they stay as long as there is room for the next.
void Proxy::Pushers::keep(const Projection& nearest) noexcept {
  const auto all = faces;
  std::array<bool, kMaxHalfSpaces> holds{};
  const int allCount = std::exchange(count, 0);
  const auto take = [&](int i) {
    faces[static_cast<std::size_t>(count++)] = all[static_cast<std::size_t>(i)];
  };
  for (int i = 0; i < nearest.count; ++i) {
    const int active = nearest.active[static_cast<std::size_t>(i)];
    holds[static_cast<std::size_t>(active)] = true;
    take(active);
  }
  for (int i = allCount - 1; circling && i >= 0 && count < kMaxHalfSpaces - 1; --i) {
    if (!holds[static_cast<std::size_t>(i)]) take(i);
  }
}

// Moves the proxy to where a face pushes it, and above those that pushed it before. Without room for that,
// the newest face has its way.
void Proxy::pushTo(const Vec3& place, const HalfSpace& face, Pushers& pushers) noexcept {
  pushers.add(face);
  expectedTravel_m_ += (place - position_).norm();
  position_ = place;
  if (pushers.count == 1) return;
  const Projection nearest =
      projectOntoActiveSet(pushers.faces.data(), pushers.count, place, place, query_.minSkin() / 16);
  const double move = (nearest.point - place).norm();
  pushers.jammed = !nearest.found || move > kJump_m;
  if (pushers.jammed) return;
  expectedTravel_m_ += move;
  position_ = nearest.point;
  pushers.keep(nearest);
}

// Each sweep gathers what is around it, of all objects: among many, one gather for all of them.
void Proxy::gatherSweeps(const Vec3& from) noexcept {
  constexpr int kMany = 16;                 // more gathers of a full storage would spend the work of a tick
  constexpr double kLongestSweep_m = 1e-3;  // a tick of 1 m/s; a faster one casts in steps
  if (query_.objectCount() <= kMany) return;
  double reach = 0;
  for (int i = 0; i < query_.objectCount(); ++i)
    reach = std::max(reach, (query_.object(i).carried(from) - position_).norm());
  if (reach > 0) query_.ensureGathered(position_, std::min(reach, kLongestSweep_m) + kGatherMargin_m);
}

// A cast in the frame of each object, from the previous place of the proxy in that frame to the present one.
// An object that jumps over the proxy takes it along without a force. One whose sweep could not be examined
// does not take it along: others might be in between.
bool Proxy::pushByObjects(const Vec3& from, Pushers& pushers, std::uint32_t& status) noexcept {
  bool pushed = false;
  for (int i = 0; i < query_.objectCount() && !pushers.jammed; ++i) {
    const PlacedObject& object = query_.object(i);
    if (!(object.moved || position_ != from) || object.deformed || object.jumped || object.before == nullptr)
      continue;
    const Vec3 start = object.carried(from);
    const Vec3 displacement = position_ - start;
    ObjectHit hit;
    if (displacement.squaredNorm() > 0 && query_.castAtObject(i, start, position_, hit) && !hit.unexamined) {
      pushTo(start + hit.stop * displacement, hit.halfSpace, pushers);
      pushed = true;
      touchedObject_ = object.state->id;
      if (object.moved && isJump(object)) releaseByJump(object, status);
    }
  }
  return pushed;
}

void Proxy::releaseByJump(const PlacedObject& object, std::uint32_t& status) noexcept {
  takenByJump(object);
  released_ = true;
  status |= kRenderGeometryJump;
}

void Proxy::takenByJump(const PlacedObject& object) noexcept {
  if (jumper_ < 0) beforeJump_ = positionBefore_;
  jumper_ = object.state->id;
}

// A closed surface that jumped has gone past the hand, and holds the proxy on its far side: the proxy returns
// to where the jump found it, or, where the surface is there now, to the hand that has left the surface. An
// open one may have risen over the hand, and keeps the proxy on the side where it was. True when it returned.
bool Proxy::returnFromJump(const Vec3& hip) noexcept {
  if (!released_) jumper_ = -1;
  if (jumper_ < 0) return false;
  const int jumper = query_.addObject(jumper_);
  if (jumper < 0) return false;
  EnclosureBudget budget;
  if (!isClear(query_.object(jumper), now_.time, position_, 0, budget)) return false;
  const auto isFree = [&](const Vec3& place) {
    if (!isClear(query_.object(jumper), now_.time, place, toolRadius_, budget)) return false;
    for (int i = 0; i < query_.objectCount(); ++i) {
      if (i != jumper && encloses(query_.object(i), query_.faces(), now_.time, place, toolRadius_, budget))
        return false;
    }
    return true;
  };
  const bool isFreeBefore = isFree(beforeJump_);
  if (!isFreeBefore && !isFree(hip)) return false;
  position_ = reported_ = isFreeBefore ? beforeJump_ : hip;
  beFree();
  return true;
}

// How far a vertex may have moved in shapes that this servo did not see, metres.
double Proxy::missedMove(const PlacedObject& object) noexcept {
  const scene::MeshGeometry& mesh = *object.state->mesh;
  if (mesh.shape - object.before->mesh->shape <= 1) return 0;
  return mesh.recentMove * object.T_device_object.linear().norm();
}

// The back of a plane is solid without end: move the proxy to the front.
bool Proxy::pushByPlanes(Pushers& pushers) noexcept {
  bool pushed = false;
  for (const PlacedPlane& plane : planes_) {
    const HalfSpace face{plane.facet.normal, plane.facet.a, query_.radiusAt(plane.facet) + plane.facet.skin};
    const double below = -face.height(position_);
    if (below <= 0.5 * plane.facet.skin || pushers.jammed) continue;
    const Vec3 displacement = below * face.normal;
    ObjectHit hit;
    if (query_.cast(position_, position_ + displacement, hit)) {
      if (hit.unexamined) {
        position_ += hit.stop * displacement;
        continue;
      }
      pushTo(position_ + hit.stop * displacement, hit.halfSpace, pushers);
      if (!pushers.jammed) pushTo(position_, face, pushers);
    } else {
      pushTo(position_ + displacement, face, pushers);
    }
    pushed = true;
  }
  return pushed;
}

// A proxy that objects keep behind a plane leaves it no room: it stays below the proxy for this tick.
void Proxy::holdPlanesBack() noexcept {
  for (const PlacedPlane& plane : planes_) {
    const double below =
        plane.facet.radius + plane.facet.skin - plane.facet.normal.dot(position_ - plane.facet.a);
    if (below > 0.5 * plane.facet.skin) planes_.lower(static_cast<int>(&plane - planes_.begin()), below);
  }
}

// As push(), for each face in its own frame; the face that passed farthest pushes first. The boxes of the
// index cover the whole deformation, so the reach need only add the motion of the placement and of the proxy.
bool Proxy::pushByDeformingFaces(const Vec3& from, Pushers& pushers, std::uint32_t& status) noexcept {
  double reach = -1;
  std::uint64_t sweeping = 0;
  for (int i = 0; i < query_.objectCount(); ++i) {
    const PlacedObject& object = query_.object(i);
    if (!object.sweptByDeforming()) continue;
    sweeping |= std::uint64_t{1} << i;
    reach = std::max(reach, (object.carried(from) - position_).norm() + missedMove(object));
  }
  if (reach < 0) return false;
  if (!query_.gather(position_, reach + kGatherMargin_m)) {
    status |= kRenderCandidateLimit;
    missed_ |= sweeping;
  }
  ObjectHit farthest;
  double height = 0;
  query_.forEachGathered(position_, std::numeric_limits<double>::infinity(), [&](const Facet& f) {
    const PlacedObject& object = query_.object(f.object);
    if (!object.sweptByDeforming() || query_.workSpent()) return;
    const Vec3 start = carriedBy(object, f.triangle, from);
    ObjectHit hit;
    if (!query_.castAtFacet(f, start, position_, hit)) return;
    const double above = hit.halfSpace.height(position_);
    if (above > -0.25 * f.skin) return;
    if (std::tuple(above, hit.object, hit.triangle) <
        std::tuple(height, farthest.object, farthest.triangle)) {
      farthest = hit;
      height = above;
    }
  });
  if (height == 0) return false;
  const PlacedObject& pusher = query_.object(farthest.object);
  if (isJump(pusher, farthest.triangle)) releaseByJump(pusher, status);
  pushTo(position_ - height * farthest.halfSpace.normal, farthest.halfSpace, pushers);
  return true;
}

}  // namespace hapticd::realtime

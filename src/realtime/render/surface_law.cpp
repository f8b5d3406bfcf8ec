#include "realtime/render/surface_law.h"

#include <algorithm>

namespace hapticd::realtime {
namespace {

// The part of one face.
struct ContactShare {
  Contact* contact = nullptr;
  double normal_N = 0;    // spring and damper
  double spring_N = 0;    // spring alone
  double friction_N = 0;  // bound that follows from the spring's force
};

// Spring and damper along the normal. The damper may reduce the force, but the surface never pulls.
double normalForce(const ContactConstraint& constraint, const Vec3& hipVelocity) {
  const scene::Surface& surface = constraint.surface;
  const double leaving = constraint.halfSpace.normal.dot(hipVelocity - constraint.surfaceVelocity_m_per_s);
  return std::max(0.0, surface.stiffness_N_per_m * constraint.depth_m - surface.damping_Ns_per_m * leaving);
}

// All faces of one object make one contact.
Contact& contactWith(std::int32_t object, Rendering& out) {
  Contact* const end = out.contacts.data() + out.contactCount;
  Contact* const known =
      std::find_if(out.contacts.data(), end, [object](const Contact& c) { return c.object == object; });
  if (known == end) {
    ++out.contactCount;
    *known = Contact{};
    known->object = object;
  }
  return *known;
}

using ContactShares = std::array<ContactShare, kMaxActive>;

// The face with the largest force gives point and normal of its object's contact.
void addNormalForces(const ContactSet& contactSet, const Vec3& proxy_m, const Vec3& hipVelocity,
                     double toolRadius_m, ContactShares& shares, Rendering& out) {
  Vec3 unshaded = Vec3::Zero();
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[static_cast<std::size_t>(i)];
    ContactShare& share = shares[static_cast<std::size_t>(i)];
    share.contact = &contactWith(constraint.object, out);
    share.normal_N = normalForce(constraint, hipVelocity);
    share.spring_N = constraint.surface.stiffness_N_per_m * constraint.depth_m;
    share.friction_N = share.spring_N * (contactSet.sliding ? constraint.surface.dynamic_friction
                                                            : constraint.surface.static_friction);
    share.contact->force_N += share.normal_N * constraint.forceDirection;
    out.normalForce_N += share.normal_N * constraint.forceDirection;
    unshaded += share.normal_N * constraint.halfSpace.normal;
    const auto harder = [&](const ContactShare& other) { return other.normal_N >= share.normal_N; };
    const auto firstOfObject = [&](const ContactShare& other) {
      return other.contact == share.contact && harder(other);
    };
    if (std::none_of(shares.data(), &share, firstOfObject)) {
      share.contact->triangle = constraint.triangle;
      share.contact->normal = constraint.halfSpace.normal;
      share.contact->point_m = proxy_m - toolRadius_m * constraint.halfSpace.normal;
    }
    if (std::none_of(shares.data(), &share, harder)) out.touchedObject = constraint.object;
  }
  // Force shading turns the force and keeps its magnitude.
  const double shaded = out.normalForce_N.norm();
  if (!(shaded > 0)) return;
  const double kept = unshaded.norm() / shaded;
  out.normalForce_N *= kept;
  for (std::uint32_t i = 0; i < out.contactCount; ++i) out.contacts[i].force_N *= kept;
}

// Friction and adhesion act along the lateral part; each face bears its share of their bound.
void addTangentialForces(const ContactSet& contactSet, const ContactShares& shares, Rendering& out) {
  Vec3 spring = Vec3::Zero();
  double friction = 0;
  double weight = 0;
  double adhesion = 0;
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[static_cast<std::size_t>(i)];
    const ContactShare& share = shares[static_cast<std::size_t>(i)];
    spring += share.spring_N * constraint.halfSpace.normal;
    friction += share.friction_N;
    weight += share.spring_N;
    adhesion += constraint.adhesion_N;
  }
  const double stretch = contactSet.lateral_m.norm();
  if (!(stretch > 0) || !(weight > 0) || !(out.depth_m > 0)) return;
  const double perFriction = out.normalForce_N.norm() / weight;
  const double limit = friction * perFriction + adhesion;
  if (!(limit > 0)) return;
  const double stiffness = spring.norm() / out.depth_m;
  const Vec3 force = contactSet.lateral_m * (std::min(stiffness * stretch, limit) / stretch);
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactShare& share = shares[static_cast<std::size_t>(i)];
    const double held =
        share.friction_N * perFriction + contactSet.constraints[static_cast<std::size_t>(i)].adhesion_N;
    share.contact->force_N += held / limit * force;
  }
  out.contactForce_N += force;
}

}  // namespace

void applySurfaceLaw(const ContactSet& contactSet, const Vec3& proxy_m, const Vec3& hipVelocity_m_per_s,
                     double toolRadius_m, Rendering& out) noexcept {
  if (contactSet.count == 0) return;
  ContactShares shares;
  addNormalForces(contactSet, proxy_m, hipVelocity_m_per_s, toolRadius_m, shares, out);
  Vec3 inward = Vec3::Zero();
  for (int i = 0; i < contactSet.count; ++i)
    inward += contactSet.constraints[static_cast<std::size_t>(i)].halfSpace.normal;
  out.touching = true;
  out.depth_m = contactSet.normal_m.norm();
  out.normal = (out.depth_m > 0 ? contactSet.normal_m : inward).normalized();
  out.scp_m = proxy_m - toolRadius_m * out.normal;
  out.contactForce_N = out.normalForce_N;
  addTangentialForces(contactSet, shares, out);
}

void applyAdhesion(const Vec3& force_N, Rendering& out) noexcept {
  if (force_N.isZero(0)) return;
  out.contactForce_N += force_N;
  Contact& contact = contactWith(-1, out);
  if (contact.normal.isZero(0)) {
    contact.normal = -force_N.normalized();
    contact.point_m = out.proxy_m;
  }
  contact.force_N += force_N;
}

}  // namespace hapticd::realtime

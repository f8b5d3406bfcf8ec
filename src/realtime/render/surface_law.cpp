#include "realtime/render/surface_law.h"

#include <algorithm>
#include <cmath>

namespace hapticd::realtime {
namespace {

// The part of one face.
struct ContactShare {
  Contact* contact = nullptr;
  double normal_N = 0;    // spring and damper
  double spring_N = 0;    // spring alone
  double friction_N = 0;  // bound of friction and adhesion
};

// Share of its damping that a face exerts beside the others: all of it where they are at right angles, and
// about one in all where they are nearly parallel, so that a seam feels as the flat surface that it divides.
// In no direction do the faces together damp more than the most damped of them: with these weights the rows
// of the matrix of the products |n_i n_j| sum up to 1, and no eigenvalue is larger than that.
double dampingShare(const ContactSet& contactSet, int face) {
  const ContactConstraint& own = contactSet.constraints[static_cast<std::size_t>(face)];
  double sum = own.depth_m;
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactConstraint& other = contactSet.constraints[static_cast<std::size_t>(i)];
    if (i != face) sum += std::abs(own.halfSpace.normal.dot(other.halfSpace.normal)) * other.depth_m;
  }
  return sum > 0 ? own.depth_m / sum : 1;
}

// Spring and damper along the normal. The damper may reduce the force, but the surface never pulls.
double normalForce(const ContactConstraint& constraint, double spring_N, double dampingShare,
                   const Vec3& hipVelocity) {
  const double leaving = constraint.leavingSpeed(hipVelocity);
  return std::max(0.0, spring_N - dampingShare * constraint.surface.damping_Ns_per_m * leaving);
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
void addNormalForces(const ContactSet& contactSet, const Springs& springs, const Vec3& proxy_m,
                     const Vec3& hipVelocity, double toolRadius_m, ContactShares& shares, Rendering& out) {
  const std::array<double, kMaxActive> forces_N = normalForces(contactSet, springs, hipVelocity);
  Vec3 unshaded = Vec3::Zero();
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[static_cast<std::size_t>(i)];
    ContactShare& share = shares[static_cast<std::size_t>(i)];
    share.contact = &contactWith(constraint.object, out);
    share.spring_N = springs.forces_N[static_cast<std::size_t>(i)];
    share.normal_N = forces_N[static_cast<std::size_t>(i)];
    share.friction_N = contactSet.frictionOf(constraint.surface) * share.normal_N + constraint.adhesion_N;
    share.contact->force_N += share.normal_N * constraint.forceDirection;
    out.normalForce_N += share.normal_N * constraint.forceDirection;
    unshaded += share.normal_N * constraint.halfSpace.normal;
    const auto harder = [&](const ContactShare& other) {
      return other.contact == share.contact && other.normal_N >= share.normal_N;
    };
    if (std::none_of(shares.data(), &share, harder)) {
      share.contact->triangle = constraint.triangle;
      share.contact->normal = constraint.halfSpace.normal;
      share.contact->point_m = proxy_m - toolRadius_m * constraint.halfSpace.normal;
    }
  }
  // Force shading turns the force and keeps its magnitude.
  const double shaded = out.normalForce_N.norm();
  if (!(shaded > 0)) return;
  const double kept = unshaded.norm() / shaded;
  out.normalForce_N *= kept;
  for (std::uint32_t i = 0; i < out.contactCount; ++i) out.contacts[i].force_N *= kept;
}

// Adds a force to the contacts in proportion to a part of their shares.
template <class Part>
void distribute(const Vec3& force, const ContactShares& shares, int count, Part&& part) {
  double all = 0;
  for (int i = 0; i < count; ++i) all += part(shares[static_cast<std::size_t>(i)]);
  if (!(all > 0)) {
    shares[0].contact->force_N += force;
    return;
  }
  for (int i = 0; i < count; ++i) {
    const ContactShare& share = shares[static_cast<std::size_t>(i)];
    share.contact->force_N += part(share) / all * force;
  }
}

// The slope of the stiffness pushes along the surfaces. Friction and adhesion bear what else the lateral part
// of the spring exerts, each contact within its bound.
void addTangentialForces(const ContactSet& contactSet, const Springs& springs, const ContactShares& shares,
                         Rendering& out) {
  Vec3 spring = Vec3::Zero();
  double bound = 0;
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactShare& share = shares[static_cast<std::size_t>(i)];
    spring += share.spring_N * contactSet.constraints[static_cast<std::size_t>(i)].halfSpace.normal;
    bound += share.friction_N;
  }
  if (!(out.depth_m > 0)) return;
  // While a face yields, the spring is shorter, and its energy changes less with the stiffness.
  const double stretch =
      springs.yields ? spring.norm() / (contactSet.spring.stiffness_N_per_m * out.depth_m) : 1;
  const Vec3 slope = stretch * stretch * (contactSet.spring.slope_N + contactSet.spring.turn_N);
  if (!slope.isZero(0)) {
    out.contactForce_N += slope;
    distribute(slope, shares, contactSet.count, [](const ContactShare& s) { return s.spring_N; });
  }
  if (!(bound > 0)) return;
  const double stiffness = spring.norm() / out.depth_m;
  const Vec3 lateral = stiffness * contactSet.lateral_m - stretch * stretch * contactSet.spring.slope_N;
  const double force = lateral.norm();
  if (!(force > 0)) return;
  const double share = std::min(1.0, bound / force);
  const Vec3 friction = share * lateral;
  out.contactForce_N += friction;
  if (contactSet.borneApart) {
    const Vec3 first = share * stiffness * contactSet.borneByFirst_m;
    shares[0].contact->force_N += first;
    shares[1].contact->force_N += friction - first;
    return;
  }
  distribute(friction, shares, contactSet.count, [](const ContactShare& s) { return s.friction_N; });
}

}  // namespace

std::array<double, kMaxActive> normalForces(const ContactSet& contactSet, const Springs& springs,
                                            const Vec3& hipVelocity_m_per_s) noexcept {
  std::array<double, kMaxActive> forces_N{};
  for (int i = 0; i < contactSet.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    forces_N[k] = normalForce(contactSet.constraints[k], springs.forces_N[k], dampingShare(contactSet, i),
                              hipVelocity_m_per_s);
  }
  return forces_N;
}

void applySurfaceLaw(const ContactSet& contactSet, const Springs& springs, const Vec3& proxy_m,
                     const Vec3& hipVelocity_m_per_s, double toolRadius_m, Rendering& out) noexcept {
  // The proxy keeps a small distance from faces, so that it may be held before the HIP is below them.
  if (contactSet.normal_m.isZero(0)) return;
  ContactShares shares;
  addNormalForces(contactSet, springs, proxy_m, hipVelocity_m_per_s, toolRadius_m, shares, out);
  Vec3 inward = Vec3::Zero();
  for (int i = 0; i < contactSet.count; ++i)
    inward += contactSet.constraints[static_cast<std::size_t>(i)].halfSpace.normal;
  out.touching = true;
  out.depth_m = contactSet.normal_m.norm();
  out.normal = (out.depth_m > 0 ? contactSet.normal_m : inward).normalized();
  out.scp_m = proxy_m - toolRadius_m * out.normal;
  out.contactForce_N = out.normalForce_N;
  addTangentialForces(contactSet, springs, shares, out);
  const auto weaker = [](const Contact& a, const Contact& b) { return a.force_N.norm() < b.force_N.norm(); };
  const Contact* const first = out.contacts.data();
  out.touchedObject = std::max_element(first, first + out.contactCount, weaker)->object;
}

const Contact* touchedContact(const Rendering& rendering) noexcept {
  if (!rendering.touching) return nullptr;
  const Contact* const end = rendering.contacts.data() + rendering.contactCount;
  const Contact* const found = std::find_if(rendering.contacts.data(), end, [&rendering](const Contact& c) {
    return c.object == rendering.touchedObject;
  });
  return found == end ? nullptr : found;
}

void applyAdhesion(const Adhesion& adhesion, Rendering& out) noexcept {
  const Vec3& force_N = adhesion.force_N;
  if (force_N.isZero(0)) return;
  out.contactForce_N += force_N;
  Contact& contact = contactWith(-1, out);
  if (contact.normal.isZero(0)) {
    contact.normal = -force_N.normalized();
    contact.point_m = adhesion.point_m;
  }
  contact.force_N += force_N;
}

}  // namespace hapticd::realtime

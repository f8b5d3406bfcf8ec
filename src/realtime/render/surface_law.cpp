#include "realtime/render/surface_law.h"

#include <algorithm>

namespace hapticd::realtime {
namespace {

// What one touched face adds.
struct Share {
  Contact* contact = nullptr;
  double normal_N = 0;    // with damping
  double spring_N = 0;    // without
  double friction_N = 0;  // bound by the spring's force
};

// Spring and damper along the normal; the damper may take from the spring but the surface never pulls.
double normalForce(const Touch& touch, const Vec3& hipVelocity) {
  const scene::Surface& surface = touch.surface;
  const double leaving = touch.plane.normal.dot(hipVelocity - touch.surfaceVelocity_m_per_s);
  return std::max(0.0, surface.stiffness_N_per_m * touch.depth_m - surface.damping_Ns_per_m * leaving);
}

// The faces of one object are one contact.
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

using Shares = std::array<Share, kMaxActive>;

// Of the faces of an object, the one that pushes hardest says where it is touched.
void pushOut(const Grip& grip, const Vec3& proxy_m, const Vec3& hipVelocity, double toolRadius_m,
             Shares& shares, Rendering& out) {
  Vec3 unshaded = Vec3::Zero();
  for (int i = 0; i < grip.count; ++i) {
    const Touch& touch = grip.touches[static_cast<std::size_t>(i)];
    Share& share = shares[static_cast<std::size_t>(i)];
    share.contact = &contactWith(touch.object, out);
    share.normal_N = normalForce(touch, hipVelocity);
    share.spring_N = touch.surface.stiffness_N_per_m * touch.depth_m;
    share.friction_N =
        share.spring_N * (grip.sliding ? touch.surface.dynamic_friction : touch.surface.static_friction);
    share.contact->force_N += share.normal_N * touch.push;
    out.normalForce_N += share.normal_N * touch.push;
    unshaded += share.normal_N * touch.plane.normal;
    const auto harder = [&](const Share& other) { return other.normal_N >= share.normal_N; };
    const auto firstOfObject = [&](const Share& other) {
      return other.contact == share.contact && harder(other);
    };
    if (std::none_of(shares.data(), &share, firstOfObject)) {
      share.contact->triangle = touch.triangle;
      share.contact->normal = touch.plane.normal;
      share.contact->point_m = proxy_m - toolRadius_m * touch.plane.normal;
    }
    if (std::none_of(shares.data(), &share, harder)) out.touchedObject = touch.object;
  }
  // Shading turns the force and keeps its size.
  const double shaded = out.normalForce_N.norm();
  if (!(shaded > 0)) return;
  const double kept = unshaded.norm() / shaded;
  out.normalForce_N *= kept;
  for (std::uint32_t i = 0; i < out.contactCount; ++i) out.contacts[i].force_N *= kept;
}

// Friction and adhesion hold the proxy back; each face bears its part of their bound.
void holdBack(const Grip& grip, const Shares& shares, Rendering& out) {
  Vec3 spring = Vec3::Zero();
  double friction = 0;
  double weight = 0;
  double adhesion = 0;
  for (int i = 0; i < grip.count; ++i) {
    const Touch& touch = grip.touches[static_cast<std::size_t>(i)];
    const Share& share = shares[static_cast<std::size_t>(i)];
    spring += share.spring_N * touch.plane.normal;
    friction += share.friction_N;
    weight += share.spring_N;
    adhesion += touch.adhesion_N;
  }
  const double stretch = grip.lateral_m.norm();
  if (!(stretch > 0) || !(weight > 0) || !(out.depth_m > 0)) return;
  const double perFriction = out.normalForce_N.norm() / weight;
  const double limit = friction * perFriction + adhesion;
  if (!(limit > 0)) return;
  const double stiffness = spring.norm() / out.depth_m;
  const Vec3 force = grip.lateral_m * (std::min(stiffness * stretch, limit) / stretch);
  for (int i = 0; i < grip.count; ++i) {
    const Share& share = shares[static_cast<std::size_t>(i)];
    const double held = share.friction_N * perFriction + grip.touches[static_cast<std::size_t>(i)].adhesion_N;
    share.contact->force_N += held / limit * force;
  }
  out.contactForce_N += force;
}

}  // namespace

void applySurfaceLaw(const Grip& grip, const Vec3& proxy_m, const Vec3& hipVelocity_m_per_s,
                     double toolRadius_m, Rendering& out) noexcept {
  if (grip.count == 0) return;
  Shares shares;
  pushOut(grip, proxy_m, hipVelocity_m_per_s, toolRadius_m, shares, out);
  Vec3 inward = Vec3::Zero();
  for (int i = 0; i < grip.count; ++i) inward += grip.touches[static_cast<std::size_t>(i)].plane.normal;
  out.touching = true;
  out.depth_m = grip.normal_m.norm();
  out.normal = (out.depth_m > 0 ? grip.normal_m : inward).normalized();
  out.scp_m = proxy_m - toolRadius_m * out.normal;
  out.contactForce_N = out.normalForce_N;
  holdBack(grip, shares, out);
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

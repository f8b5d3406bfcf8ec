#include "realtime/render/surface_law.h"

#include <algorithm>

namespace hapticd::realtime {
namespace {

// Spring and damper along the normal; the damper may take from the spring but the surface never pulls.
double normalForce(const Touch& touch, const Vec3& hipVelocity) {
  const scene::Surface& surface = touch.surface;
  const double leaving = touch.plane.normal.dot(hipVelocity - touch.surfaceVelocity_m_per_s);
  return std::max(0.0, surface.stiffness_N_per_m * touch.depth_m - surface.damping_Ns_per_m * leaving);
}

}  // namespace

void applySurfaceLaw(const Grip& grip, const Vec3& proxy_m, const Vec3& hipVelocity_m_per_s,
                     double toolRadius_m, Rendering& out) noexcept {
  Vec3 spring = Vec3::Zero();
  Vec3 inward = Vec3::Zero();
  double friction = 0;
  double adhesion = 0;
  double weight = 0;
  double hardest = -1;
  for (int i = 0; i < grip.count; ++i) {
    const Touch& touch = grip.touches[static_cast<std::size_t>(i)];
    const scene::Surface& surface = touch.surface;
    const double force = normalForce(touch, hipVelocity_m_per_s);
    Contact& contact = out.contacts[out.contactCount++];
    contact.object = touch.object;
    contact.triangle = touch.triangle;
    contact.normal = touch.plane.normal;
    contact.point_m = proxy_m - toolRadius_m * touch.plane.normal;
    contact.force_N = force * touch.push;
    out.normalForce_N += contact.force_N;
    const double springForce = surface.stiffness_N_per_m * touch.depth_m;
    spring += springForce * touch.plane.normal;
    inward += touch.plane.normal;
    friction += springForce * (grip.sliding ? surface.dynamic_friction : surface.static_friction);
    adhesion += touch.adhesion_N;
    weight += springForce;
    if (force > hardest) {
      hardest = force;
      out.touchedObject = contact.object;
    }
  }
  if (grip.count == 0) return;
  out.touching = true;
  out.depth_m = grip.normal_m.norm();
  const Vec3 along = out.depth_m > 0 ? grip.normal_m : inward;
  out.normal = along.normalized();
  out.scp_m = proxy_m - toolRadius_m * out.normal;
  out.contactForce_N = out.normalForce_N;
  const double stretch = grip.lateral_m.norm();
  if (stretch > 0 && weight > 0 && out.depth_m > 0) {
    const double stiffness = spring.norm() / out.depth_m;
    const double limit = friction / weight * out.normalForce_N.norm() + adhesion;
    out.contactForce_N += grip.lateral_m * (std::min(stiffness * stretch, limit) / stretch);
  }
}

}  // namespace hapticd::realtime

#include "realtime/remote/remote_shape.h"

#include <cmath>

namespace hapticd::realtime {
namespace {

// Below this distance from a centre or an axis the direction is that of the stated point.
constexpr double kCentre_m = 1e-9;

Vec3 turned(const Vec3& v, const Vec3& axis, double cosine, double sine) noexcept {
  return cosine * v + sine * axis.cross(v) + (1 - cosine) * axis.dot(v) * axis;
}

}  // namespace

SurfaceAt surfaceAt(const RemoteContact& contact, double age_s, const Vec3& hip_m) noexcept {
  SurfaceAt at;
  at.point_m = contact.point_m + age_s * contact.velocity_m_per_s;
  at.normal = contact.normal;
  Vec3 axis = contact.axis;
  if (!contact.angularVelocity_rad_per_s.isZero(0)) {
    const double speed = contact.angularVelocity_rad_per_s.norm();
    const Vec3 about = contact.angularVelocity_rad_per_s / speed;
    const double cosine = std::cos(speed * age_s);
    const double sine = std::sin(speed * age_s);
    at.normal = turned(at.normal, about, cosine, sine);
    axis = turned(axis, about, cosine, sine);
  }
  if (contact.shape == RemoteShape::halfSpace) {
    at.depth_m = at.normal.dot(at.point_m - hip_m);
    return at;
  }
  Vec3 fromCentre = hip_m - (at.point_m - contact.radius_m * at.normal);
  if (contact.shape == RemoteShape::cylinder) fromCentre -= axis.dot(fromCentre) * axis;
  const double distance = fromCentre.norm();
  const double side = contact.radius_m < 0 ? -1 : 1;
  if (distance > kCentre_m) at.normal = side / distance * fromCentre;
  at.depth_m = contact.radius_m - side * distance;
  return at;
}

}  // namespace hapticd::realtime

#include "realtime/remote/remote_shape.h"

#include <cmath>

namespace hapticd::realtime {
namespace {

// Below this distance from a centre or an axis the direction is that of the stated point.
constexpr double kCentre_m = 1e-9;

// Below this angle, squared, the series of sine and cosine are exact to the last digits.
constexpr double kSeries = 0.1;

struct TurnFactors {
  double sine;    // of the angle, over the angle
  double versed;  // 1 - cosine, over the square of the angle
  double rest;    // 1 - sine over the angle, over the square of the angle
};

TurnFactors turnFactors(double square) noexcept {
  if (square > kSeries) {
    const double angle = std::sqrt(square);
    const double sine = std::sin(angle) / angle;
    return {sine, (1 - std::cos(angle)) / square, (1 - sine) / square};
  }
  const double q = -square;
  const double q2 = q * q;
  const auto sum = [&](double c0, double c1, double c2, double c3, double c4, double c5) {
    return (c0 + q * c1) + q2 * ((c2 + q * c3) + q2 * (c4 + q * c5));
  };
  return {sum(1, 1.0 / 6, 1.0 / 120, 1.0 / 5040, 1.0 / 362880, 1.0 / 39916800),
          sum(1.0 / 2, 1.0 / 24, 1.0 / 720, 1.0 / 40320, 1.0 / 3628800, 1.0 / 479001600),
          sum(1.0 / 6, 1.0 / 120, 1.0 / 5040, 1.0 / 362880, 1.0 / 39916800, 1.0 / 6227020800)};
}

Vec3 turnedBy(const Vec3& rotation, const Vec3& v, const TurnFactors& f) noexcept {
  const double square = rotation.squaredNorm();
  return (1 - square * f.versed) * v + f.sine * rotation.cross(v) + f.versed * rotation.dot(v) * rotation;
}

// Of a point whose velocity turns with the body: `way` is that of a body that does not turn.
Vec3 wayOfTwist(const Vec3& rotation, const Vec3& way, const TurnFactors& f) noexcept {
  const Vec3 across = rotation.cross(way);
  return way + f.versed * across + f.rest * rotation.cross(across);
}

}  // namespace

Vec3 turnedBy(const Vec3& rotation, const Vec3& v) noexcept {
  return turnedBy(rotation, v, turnFactors(rotation.squaredNorm()));
}

void moveBy(const geometry::Affine& motion, RemoteContact& contact) noexcept {
  const geometry::Mat3 linear = motion.linear();
  const double scale = geometry::scaleOf(linear);
  contact.point_m = motion * contact.point_m;
  contact.normal = (linear * contact.normal).normalized();
  contact.axis = (linear * contact.axis).normalized();
  contact.velocity_m_per_s = linear * contact.velocity_m_per_s;
  contact.angularVelocity_rad_per_s = linear * contact.angularVelocity_rad_per_s / scale;
  contact.radius_m *= scale;
}

SurfaceAt surfaceAt(const RemoteContact& contact, double age_s, const Vec3& hip_m) noexcept {
  const bool flat = contact.shape == RemoteShape::halfSpace;
  const Vec3& spin = contact.angularVelocity_rad_per_s;
  const Vec3 toCentre = flat ? Vec3(Vec3::Zero()) : Vec3(-contact.radius_m * contact.normal);
  const Vec3 stated_m = contact.point_m + toCentre;
  SurfaceAt at;
  at.normal = contact.normal;
  at.velocity_m_per_s = contact.velocity_m_per_s;
  Vec3 axis = contact.axis;
  Vec3 moved_m = stated_m + age_s * at.velocity_m_per_s;
  if (!spin.isZero(0)) {
    at.velocity_m_per_s += spin.cross(toCentre);
    const Vec3 rotation = age_s * spin;
    const TurnFactors factors = turnFactors(rotation.squaredNorm());
    at.normal = turnedBy(rotation, at.normal, factors);
    if (contact.shape == RemoteShape::cylinder) axis = turnedBy(rotation, axis, factors);
    const Vec3 way_m = age_s * at.velocity_m_per_s;
    moved_m = stated_m + (flat ? wayOfTwist(rotation, way_m, factors) : way_m);
    at.velocity_m_per_s += spin.cross(hip_m - (flat ? stated_m : moved_m));
  }
  if (flat) {
    at.depth_m = at.normal.dot(moved_m - hip_m);
    return at;
  }
  Vec3 fromCentre = hip_m - moved_m;
  if (contact.shape == RemoteShape::cylinder) fromCentre -= axis.dot(fromCentre) * axis;
  const double distance = fromCentre.norm();
  const double side = contact.radius_m < 0 ? -1 : 1;
  if (distance > kCentre_m) at.normal = side / distance * fromCentre;
  at.depth_m = contact.radius_m - side * distance;
  return at;
}

}  // namespace hapticd::realtime

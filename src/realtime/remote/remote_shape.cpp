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
};

TurnFactors turnFactors(double square) noexcept {
  if (square > kSeries) {
    const double angle = std::sqrt(square);
    return {std::sin(angle) / angle, (1 - std::cos(angle)) / square};
  }
  const double q = -square;
  const double q2 = q * q;
  const auto sum = [&](double c0, double c1, double c2, double c3, double c4, double c5) {
    return (c0 + q * c1) + q2 * ((c2 + q * c3) + q2 * (c4 + q * c5));
  };
  return {sum(1, 1.0 / 6, 1.0 / 120, 1.0 / 5040, 1.0 / 362880, 1.0 / 39916800),
          sum(1.0 / 2, 1.0 / 24, 1.0 / 720, 1.0 / 40320, 1.0 / 3628800, 1.0 / 479001600)};
}

Vec3 turnedBy(const Vec3& rotation, const Vec3& v, const TurnFactors& f) noexcept {
  const double square = rotation.squaredNorm();
  return (1 - square * f.versed) * v + f.sine * rotation.cross(v) + f.versed * rotation.dot(v) * rotation;
}

}  // namespace

Vec3 turnedBy(const Vec3& rotation, const Vec3& v) noexcept {
  return turnedBy(rotation, v, turnFactors(rotation.squaredNorm()));
}

SurfaceAt surfaceAt(const RemoteContact& contact, double age_s, const Vec3& hip_m) noexcept {
  SurfaceAt at;
  at.point_m = contact.point_m + age_s * contact.velocity_m_per_s;
  at.normal = contact.normal;
  Vec3 axis = contact.axis;
  if (!contact.angularVelocity_rad_per_s.isZero(0)) {
    const Vec3 rotation = age_s * contact.angularVelocity_rad_per_s;
    const TurnFactors factors = turnFactors(rotation.squaredNorm());
    at.normal = turnedBy(rotation, at.normal, factors);
    if (contact.shape == RemoteShape::cylinder) axis = turnedBy(rotation, axis, factors);
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

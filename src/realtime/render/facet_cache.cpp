#include "realtime/render/facet_cache.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hapticd::realtime {
namespace {

constexpr double kClear = 2;              // in skins: beyond the radius, the ball is free of a face
constexpr float kSingleRounding = 1e-6F;  // relative; eight times that of one operation

}  // namespace

double exitOfBall(const Vec3& p, const Vec3& d, const Vec3& centre, double radius) noexcept {
  const Vec3 m = p - centre;
  if ((m + d).squaredNorm() <= radius * radius) return 1;
  const double a = d.squaredNorm();
  const double b = m.dot(d);
  const double c = m.squaredNorm() - radius * radius;
  const double root = std::sqrt(std::max(0.0, b * b - a * c));
  return std::clamp((root - b) / a, 0.0, 1.0);
}

void FacetCache::restart(const Vec3& from, const Vec3& way, double reach) noexcept {
  from_ = from;
  way_ = way;
  centre_ = toolPosition_ = from + 0.5 * way;
  reach_ = reach;
  complete_ = true;
  count_ = 0;
  maxSkin_ = 0;
  maxRadius_ = 0;
  rounding_ = 0;
  knowsAll_ = true;
  travel_ = 0;
  nearDistance_ = -1;
}

void FacetCache::add(const Facet& facet, bool deforming) noexcept {
  const double limit = reach_ + facet.radius + 4 * facet.skin;
  // Of thin triangles, many have their planes near the tool and not themselves.
  const auto isBeyond = [&] {
    return std::abs(facet.normal.dot(centre_ - facet.a)) > limit ||
           (centre_ - nearestPointOf(facet, centre_)).squaredNorm() > limit * limit;
  };
  if (!deforming && isBeyond()) return;
  if (count_ == kMaxFacets) return invalidate();
  const auto i = static_cast<std::size_t>(count_++);
  facets_[i] = facet;
  const Vec3 middle = 0.5 * (facet.a + facet.b);  // of the longest edge
  distances_[i] = 0;
  measured_[i] = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 3; ++k) {
    filter_.normal[k][i] = facet.normal[static_cast<int>(k)];
    filter_.centre[k][i] = middle[static_cast<int>(k)];
  }
  filter_.offset[i] = facet.normal.dot(facet.a);
  filter_.radius[i] = facet.extent;
  maxSkin_ = std::max(maxSkin_, facet.skin);
  maxRadius_ = std::max(maxRadius_, facet.radius);
}

void FacetCache::add(const TriangleId& id, const Vec3& middle, double radius, double skin) noexcept {
  if (count_ == kMaxTriangles) return invalidate();
  const auto i = static_cast<std::size_t>(count_++);
  triangles_[i] = id;
  supportPlanes_[i] = {Vec3::Zero(), 0};
  set(i, {middle, radius, Vec3::Constant(std::numeric_limits<double>::quiet_NaN())});
  knowsAll_ = false;
  maxSkin_ = std::max(maxSkin_, skin);
}

void FacetCache::add(const TriangleId& id, const Disc& disc, double skin, double rounding) noexcept {
  if (count_ == kMaxTriangles) return invalidate();
  const auto i = static_cast<std::size_t>(count_++);
  triangles_[i] = id;
  supportPlanes_[i] = {Vec3::Zero(), 0};
  set(i, disc);
  rounding_ = std::max(rounding_, rounding);
  maxSkin_ = std::max(maxSkin_, skin);
}

void FacetCache::set(std::size_t i, const Disc& disc) noexcept {
  const Vec3f centre = (disc.centre - centre_).cast<float>();
  for (std::size_t k = 0; k < 3; ++k) {
    discCentres_[k][i] = centre[static_cast<int>(k)];
    discNormals_[k][i] = static_cast<float>(disc.normal[static_cast<int>(k)]);
  }
  discRadii_[i] = static_cast<float>(disc.radius) + kSingleRounding * centre.cwiseAbs().maxCoeff();
}

double FacetCache::exitOf(const Vec3& p, const Vec3& d) const noexcept {
  if (way_.isZero(0)) return exitOfBall(p, d, centre_, reach_);
  if (covers(p + d, 0)) return 1;
  // What is covered is convex.
  constexpr int kHalvings = 12;
  double inside = 0;
  double step = 0.5;
  for (int i = 0; i < kHalvings; ++i, step *= 0.5) {
    if (covers(p + (inside + step) * d, 0)) inside += step;
  }
  return inside;
}

FacetCache::Reach FacetCache::reachOf(const Vec3& p, const Vec3& d, double distance) const noexcept {
  Reach reach;
  reach.from = (p - centre_).cast<float>();
  reach.way = d.cast<float>();
  reach.length2 = reach.way.squaredNorm();
  reach.distance = static_cast<float>(distance + rounding_) +
                   kSingleRounding * (reach.from.cwiseAbs() + reach.way.cwiseAbs()).maxCoeff();
  reach.distance2 = reach.distance * reach.distance;
  return reach;
}

// Whether the path comes near the disc around triangle i. True where a number is not one.
bool FacetCache::reaches(const Reach& reach, std::size_t i) const noexcept {
  const Vec3f offset = reach.from - Vec3f(discCentres_[0][i], discCentres_[1][i], discCentres_[2][i]);
  return !(geometry::missOfDisc(reach, offset.x(), offset.y(), offset.z(), discNormals_[0][i],
                                discNormals_[1][i], discNormals_[2][i], discRadii_[i], kSingleRounding) > 0);
}

// reaches() for all of them, whose normals are known: above 0 where it is false.
void FacetCache::missDiscs(const Reach& reach) noexcept {
  const auto count = static_cast<std::size_t>(count_);
  const auto& [cx, cy, cz] = discCentres_;
  const auto& [nx, ny, nz] = discNormals_;
  for (std::size_t i = 0; i < count; ++i) {
    misses_[i] =
        geometry::missOfDisc(reach, reach.from.x() - cx[i], reach.from.y() - cy[i], reach.from.z() - cz[i],
                             nx[i], ny[i], nz[i], discRadii_[i], kSingleRounding);
  }
}

// By how much the path misses the ball around each triangle (square metres).
void FacetCache::missBalls(const Reach& reach) noexcept {
  const float perLength2 = reach.length2 > 0 ? 1 / reach.length2 : 0;
  const auto count = static_cast<std::size_t>(count_);
  const auto& [cx, cy, cz] = discCentres_;
  for (std::size_t i = 0; i < count; ++i) {
    const float x = cx[i] - reach.from.x();
    const float y = cy[i] - reach.from.y();
    const float z = cz[i] - reach.from.z();
    const float along = (x * reach.way.x() + y * reach.way.y() + z * reach.way.z()) * perLength2;
    const float share = std::min(std::max(along, 0.0F), 1.0F);
    const float ax = x - share * reach.way.x();
    const float ay = y - share * reach.way.y();
    const float az = z - share * reach.way.z();
    const float farthest = reach.distance + discRadii_[i];
    misses_[i] = ax * ax + ay * ay + az * az - farthest * farthest;
  }
}

// The plane through the point of disc i nearest to p, relative to centre_, with the disc on its back.
FacetCache::NearPlane FacetCache::planeBefore(std::size_t i, const Vec3f& p) const noexcept {
  const Vec3f offset = p - Vec3f(discCentres_[0][i], discCentres_[1][i], discCentres_[2][i]);
  const Vec3f normal(discNormals_[0][i], discNormals_[1][i], discNormals_[2][i]);
  const Vec3f up = normal.dot(offset) * normal;
  const Vec3f aside = offset - up;
  const float length = aside.norm();
  const Vec3f away = length > discRadii_[i] ? Vec3f(up + (1 - discRadii_[i] / length) * aside) : up;
  const float distance = away.norm();
  const Vec3f towards = distance > 0 ? Vec3f(away / distance) : Vec3f(Vec3f::Zero());
  return {towards,
          distance - kSingleRounding * (4 * offset.norm() + p.norm()) - static_cast<float>(rounding_)};
}

void FacetCache::makeNearPlanes() noexcept {
  const Vec3f from = (nearCentre_ - centre_).cast<float>();
  scans_ += 4 * nearCount_;  // not several at once
  for (std::size_t k = 0; k < static_cast<std::size_t>(nearCount_); ++k) {
    const NearPlane plane = planeBefore(near_[k], from);
    for (std::size_t axis = 0; axis < 3; ++axis) nearNormals_[axis][k] = plane.normal[static_cast<int>(axis)];
    nearBounds_[k] = plane.distance;
  }
}

// Of the near ones: those whose planes do not rule out the path.
std::span<const std::uint16_t> FacetCache::nearPlanesMet(const Vec3& d, double distance) noexcept {
  const Vec3f begin = (toolPosition_ - nearCentre_).cast<float>();
  const Vec3f end = begin + d.cast<float>();
  const float limit = static_cast<float>(distance) +
                      kSingleRounding * (static_cast<float>(distance) + begin.norm() + end.norm());
  const auto count = static_cast<std::size_t>(nearCount_);
  const auto& [x, y, z] = nearNormals_;
  scans_ += nearCount_ / 2;
  // By how much the path misses the tool's reach of a disc, at least.
  for (std::size_t k = 0; k < count; ++k) {
    const float here = x[k] * begin.x() + y[k] * begin.y() + z[k] * begin.z();
    const float there = x[k] * end.x() + y[k] * end.y() + z[k] * end.z();
    misses_[k] = nearBounds_[k] + std::min(here, there) - limit;
  }
  int n = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (!(misses_[k] > 0)) found_[static_cast<std::size_t>(n++)] = near_[k];
  }
  return {found_.data(), static_cast<std::size_t>(n)};
}

int FacetCache::facetsNearPath(const Vec3& p, const Vec3& d, std::uint16_t* found) const noexcept {
  const double height = maxRadius_ + kClear * maxSkin_;
  const Vec3 half = 0.5 * d;
  const Vec3 middle = p + half;
  const double reach = half.norm() + height;
  const auto& [normal, offset, centre, radius] = filter_;
  // By how much the path misses the plane of a face (metres) and the ball around it (square metres). Without
  // branches, so that the compiler computes several at once.
  std::array<double, kMaxFacets> missesPlane;
  std::array<double, kMaxFacets> missesBall;
  const auto count = static_cast<std::size_t>(count_);
  for (std::size_t i = 0; i < count; ++i) {
    const double above = normal[0][i] * middle.x() + normal[1][i] * middle.y() + normal[2][i] * middle.z();
    const double along = normal[0][i] * half.x() + normal[1][i] * half.y() + normal[2][i] * half.z();
    missesPlane[i] = std::abs(above - offset[i]) - std::abs(along) - height;
    const double x = centre[0][i] - middle.x();
    const double y = centre[1][i] - middle.y();
    const double z = centre[2][i] - middle.z();
    const double farthest = radius[i] + reach;
    missesBall[i] = x * x + y * y + z * z - farthest * farthest;
  }
  int n = 0;
  for (std::size_t i = 0; i < count; ++i) {
    found[n] = static_cast<std::uint16_t>(i);
    n += missesPlane[i] < 0 && missesBall[i] <= 0 ? 1 : 0;
  }
  return n;
}

bool FacetCache::isWithin(double distance, int k) noexcept {
  const auto i = static_cast<std::size_t>(k);
  if (distances_[i] > distance + travel_) return false;
  if (distances_[i] - 2 * measured_[i] <= distance - travel_) return true;
  const double here = (toolPosition_ - nearestPointOf(facets_[i], toolPosition_)).norm();
  distances_[i] = here + travel_;
  measured_[i] = travel_;
  return here <= distance;
}

void FacetCache::moveTo(const Vec3& p) noexcept {
  if (p == toolPosition_) return;
  travel_ += (p - toolPosition_).norm();
  toolPosition_ = p;
}

// The distance from a face is convex: its tangent is a lower bound.
double FacetCache::lowerBound(int k, const Vec3& d) const noexcept {
  const SupportPlane& plane = supportPlanes_[static_cast<std::size_t>(k)];
  return plane.normal.dot(toolPosition_) - plane.offset + std::min(0.0, plane.normal.dot(d));
}

double FacetCache::refine(int k, const Vec3& foot, const Vec3& d) noexcept {
  const Vec3 away = toolPosition_ - foot;
  const double distance = away.norm();
  const Vec3 normal = distance > 0 ? Vec3(away / distance) : Vec3(Vec3::Zero());
  supportPlanes_[static_cast<std::size_t>(k)] = {normal, normal.dot(toolPosition_) - distance};
  return distance + std::min(0.0, normal.dot(d));
}

void FacetCache::exclude(int k) noexcept {
  supportPlanes_[static_cast<std::size_t>(k)] = {Vec3::Zero(), -std::numeric_limits<double>::infinity()};
}

}  // namespace hapticd::realtime

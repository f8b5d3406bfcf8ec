#include "truth/reference.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hapticd::truth {
namespace {

// A renderer may leave out triangles whose height is this share of the largest coordinate.
constexpr double kThin = 2e-8;

Point nearestOnEdge(const Point& a, const Point& b, const Point& x) {
  const Point e = b - a;
  const double length2 = e.squaredNorm();
  return length2 > 0 ? Point(a + std::clamp(e.dot(x - a) / length2, 0.0, 1.0) * e) : a;
}

bool over(const Face& f, const Point& x, double widening) {
  if (f.unbounded) return true;
  const auto beyond = [&](const Point& u, const Point& v) {
    const Point e = v - u;
    return f.normal.cross(e).dot(x - u) < -widening * e.norm();
  };
  return !beyond(f.a, f.b) && !beyond(f.b, f.c) && !beyond(f.c, f.a);
}

// Of two segments, by alternating projection: convex, so it converges; two rounds from both ends suffice for
// a bound from above, and the exact minimum follows from the closed form when the lines are not parallel.
double distanceOfSegments(const Point& p, const Point& q, const Point& a, const Point& b) {
  const Point d = q - p;
  const Point e = b - a;
  const Point r = p - a;
  const double dd = d.squaredNorm();
  const double ee = e.squaredNorm();
  const double de = d.dot(e);
  const double denominator = dd * ee - de * de;
  double s = denominator > 1e-14 * dd * ee
                 ? std::clamp((de * e.dot(r) - ee * d.dot(r)) / denominator, 0.0, 1.0)
                 : 0.0;
  double nearest = std::numeric_limits<double>::infinity();
  const auto consider = [&](double t) {
    const Point x = p + t * d;
    nearest = std::min(nearest, (x - nearestOnEdge(a, b, x)).norm());
    return nearestOnEdge(a, b, x);
  };
  const Point foot = consider(s);
  if (dd > 0) consider(std::clamp(d.dot(foot - p) / dd, 0.0, 1.0));
  consider(0);
  consider(1);
  for (const Point& end : {a, b}) nearest = std::min(nearest, (end - nearestOnEdge(p, q, end)).norm());
  return nearest;
}

Eigen::Quaterniond between(const Eigen::Quaterniond& a, Eigen::Quaterniond b, double s) {
  double cosine = a.dot(b);
  if (cosine < 0) {
    b.coeffs() = -b.coeffs();
    cosine = -cosine;
  }
  if (cosine > 1 - 1e-15) return a;
  const double angle = std::acos(std::min(cosine, 1.0));
  Eigen::Quaterniond q;
  q.coeffs() = (std::sin((1 - s) * angle) * a.coeffs() + std::sin(s * angle) * b.coeffs()) / std::sin(angle);
  return q.normalized();
}

}  // namespace

Point nearestOf(const Face& f, const Point& x) {
  const Point foot = x - f.normal * f.normal.dot(x - f.a);
  if (!f.normal.isZero(0) && over(f, foot, 0)) return foot;
  Point nearest = nearestOnEdge(f.a, f.b, x);
  for (const Point& candidate : {nearestOnEdge(f.b, f.c, x), nearestOnEdge(f.c, f.a, x)}) {
    if ((candidate - x).squaredNorm() < (nearest - x).squaredNorm()) nearest = candidate;
  }
  return nearest;
}

double distanceOf(const Face& f, const Point& p, const Point& q) {
  const double start = f.normal.dot(p - f.a);
  const double end = f.normal.dot(q - f.a);
  if (f.unbounded) return std::max(0.0, std::min(std::abs(start), std::abs(end))) * (start * end > 0 ? 1 : 0);
  if (start * end <= 0 && start != end && over(f, p + start / (start - end) * (q - p), 0)) return 0;
  double nearest = std::min((p - nearestOf(f, p)).norm(), (q - nearestOf(f, q)).norm());
  nearest = std::min(nearest, distanceOfSegments(p, q, f.a, f.b));
  nearest = std::min(nearest, distanceOfSegments(p, q, f.b, f.c));
  return std::min(nearest, distanceOfSegments(p, q, f.c, f.a));
}

Reference::Reference(const Trial& trial) : trial_(trial) {
  for (const TrialObject& object : trial.objects) {
    firstFace_.push_back(faces_.size());
    faces_.resize(faces_.size() + object.triangles.size());
  }
  firstFace_.push_back(faces_.size());
  placements_.resize(trial.objects.size());
  const auto n = static_cast<Eigen::Index>(faces_.size() + trial.planes.size());
  for (Eigen::ArrayXd* array : {&normalX_, &normalY_, &normalZ_, &offset_}) array->resize(n);
  for (const TrialPlane& plane : trial.planes) {
    Face& f = faces_.emplace_back();
    f.a = f.b = f.c = -plane.offset_m * plane.normal;
    f.normal = plane.normal;
    f.object = -1 - static_cast<int>(&plane - trial.planes.data());
    f.unbounded = true;
    setHeights(faces_.size() - 1);
  }
}

Reference::Placement Reference::placementAt(const TrialObject& object, int tick) {
  const auto last = static_cast<int>(object.poses.size()) - 1;
  const int k = std::min(tick / kPoseTicks, last);
  const Pose& from = object.poses[static_cast<std::size_t>(k)];
  const Pose& to = object.poses[static_cast<std::size_t>(std::min(k + 1, last))];
  const double s = k == last ? 0.0 : static_cast<double>(tick - k * kPoseTicks) / kPoseTicks;
  Placement out;
  const Point scale = (1 - s) * from.scale + s * to.scale;
  out.linear = (s == 0 ? from.rotation : between(from.rotation, to.rotation, s)).toRotationMatrix() *
               scale.asDiagonal();
  out.origin = (1 - s) * from.position_m + s * to.position_m;
  return out;
}

void Reference::place(std::size_t i, int tick) {
  const TrialObject& object = trial_.objects[i];
  placements_[i] = placementAt(object, tick);
  const Placement& placement = placements_[i];
  const bool mirrored = placement.linear.determinant() < 0;
  std::vector<Point> corners;
  corners.reserve(object.vertices.size());
  double progress = 0;
  if (!object.target.empty()) {
    progress = std::clamp(
        static_cast<double>(tick - object.morphBegin) / (object.morphEnd - object.morphBegin), 0.0, 1.0);
  }
  for (std::size_t k = 0; k < object.vertices.size(); ++k) {
    Point x = object.vertices[k].cast<double>();
    if (progress > 0) x += progress * (object.target[k].cast<double>() - x);
    corners.emplace_back(placement.linear * x + placement.origin);
    if (corners.back().allFinite()) extent_ = std::max(extent_, corners.back().cwiseAbs().maxCoeff());
  }
  for (std::size_t k = 0; k < object.triangles.size(); ++k) {
    const auto& t = object.triangles[k];
    Face& f = faces_[firstFace_[i] + k];
    f = {corners[t[0]], corners[t[mirrored ? 2 : 1]], corners[t[mirrored ? 1 : 2]], Point::Zero(),
         static_cast<int>(i)};
    const Point cross = (f.b - f.a).cross(f.c - f.a);
    const double area2 = cross.norm();
    const double longest = std::sqrt(
        std::max({(f.b - f.a).squaredNorm(), (f.c - f.b).squaredNorm(), (f.a - f.c).squaredNorm()}));
    f.thin = !(area2 > kThin * std::max(extent_, 1e-3) * longest);
    if (area2 > 0 && std::isfinite(area2)) {
      f.normal = cross / area2;
      f.width = area2 / longest;
    }
    setHeights(firstFace_[i] + k);
  }
}

void Reference::setHeights(std::size_t face) {
  const Face& f = faces_[face];
  const auto index = static_cast<Eigen::Index>(face);
  normalX_[index] = f.normal.x();
  normalY_[index] = f.normal.y();
  normalZ_[index] = f.normal.z();
  offset_[index] = f.normal.dot(f.a);
}

const Material& Reference::materialOf(int i) const {
  const int object = face(i).object;
  return object < 0 ? trial_.planes[static_cast<std::size_t>(-1 - object)].material
                    : trial_.objects[static_cast<std::size_t>(object)].material;
}

void Reference::moveTo(int tick) {
  const bool first = tick_ < 0;
  moved_ = false;
  if (!first && !trial_.isStatic()) {
    facesBefore_ = faces_;
    placementsBefore_ = placements_;
  }
  for (std::size_t i = 0; i < trial_.objects.size(); ++i) {
    const TrialObject& object = trial_.objects[i];
    const int end = std::max((static_cast<int>(object.poses.size()) - 1) * kPoseTicks,
                             object.target.empty() ? 0 : object.morphEnd);
    if (!first && tick_ >= end) continue;
    place(i, tick);
    moved_ = moved_ || !first;
  }
  tick_ = tick;
}

void Reference::heights(const Point& x, Eigen::ArrayXd& out) const {
  out = normalX_ * x.x() + normalY_ * x.y() + normalZ_ * x.z() - offset_;
}

std::vector<int> Reference::near(const Point& x, double radius) const {
  std::vector<int> found;
  Eigen::ArrayXd height;
  heights(x, height);
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    if (std::abs(height[static_cast<Eigen::Index>(i)]) > radius) continue;
    if ((nearestOf(faces_[i], x) - x).norm() <= radius) found.push_back(static_cast<int>(i));
  }
  return found;
}

Point Reference::carriedByObject(const Point& p, int object) const {
  const auto i = static_cast<std::size_t>(object);
  if (!moved_ || !trial_.objects[i].moves()) return p;
  return placements_[i].origin +
         placements_[i].linear * (placementsBefore_[i].linear.inverse() * (p - placementsBefore_[i].origin));
}

Point Reference::carried(const Point& p, int face) const {
  if (!moved_) return p;
  const Face& now = faces_[static_cast<std::size_t>(face)];
  if (now.unbounded) return p;
  if (trial_.objects[static_cast<std::size_t>(now.object)].target.empty())
    return carriedByObject(p, now.object);
  const Face& then = facesBefore_[static_cast<std::size_t>(face)];
  Eigen::Matrix3d frame;
  frame << then.b - then.a, then.c - then.a, then.normal;
  if (std::abs(frame.determinant()) == 0) return p;
  const Point local = frame.inverse() * (p - then.a);
  return now.a + local.x() * (now.b - now.a) + local.y() * (now.c - now.a) + local.z() * now.normal;
}

double Reference::rounding() const {
  return 1e-9 + 8e-9 * std::max(extent_, 1e-3);
}

// The rounding of its corners tilts the plane of a narrow face: its height is known the less the farther a
// place is beyond the face, in widths.
bool Reference::onPlane(const Face& f, const Point& p) const {
  const double height = std::abs(f.normal.dot(p - f.a));
  const double least = kOnPlane * rounding();
  if (height <= least || f.unbounded) return height <= least;
  if (height > least * (1 + (p - f.a).norm() / f.width)) return false;
  const double distance2 = (nearestOf(f, p) - p).squaredNorm();
  return height <= least * (1 + std::sqrt(std::max(0.0, distance2 - height * height)) / f.width);
}

bool Reference::pierces(int i, const Point& p, const Point& q, double widening) const {
  const Face& f = face(i);
  const double start = f.normal.dot(p - f.a);
  const double end = f.normal.dot(q - f.a);
  return (start >= 0) != (end >= 0) && over(f, p + start / (start - end) * (q - p), widening);
}

bool Reference::crosses(int i, const Point& p, const Point& q, double widening) const {
  const Face& f = face(i);
  return touchableFrom(f, f.normal.dot(p - f.a)) && pierces(i, p, q, widening);
}

}  // namespace hapticd::truth

#include "device/simulated/waypoint_path.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "base/time.h"

namespace hapticd::device {
namespace {

// Slope at a point between two secants: none at an extreme, else their weighted harmonic mean.
double slope(double before, double after, double lengthBefore, double lengthAfter) {
  if (before * after <= 0) return 0;
  const double w1 = 2 * lengthAfter + lengthBefore;
  const double w2 = lengthAfter + 2 * lengthBefore;
  return (w1 + w2) / (w1 / before + w2 / after);
}

}  // namespace

WaypointPath::WaypointPath(std::vector<Waypoint> points, Repeat repeat, double strength_N)
    : points_(std::move(points)), repeat_(repeat == Repeat::yes), strength_N_(strength_N) {
  if (points_.empty()) throw std::invalid_argument("a path needs at least one point");
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Waypoint& point = points_[i];
    const std::string where = "point " + std::to_string(i) + " of the path: ";
    if (!std::isfinite(point.time_s) || !point.position_m.allFinite() ||
        !point.orientation.coeffs().allFinite() || point.orientation.norm() == 0) {
      throw std::invalid_argument(where + "a value is not a finite number, or the orientation is zero");
    }
    point.orientation.normalize();
    times_.push_back(base::toNanos(point.time_s));
    if (i > 0 && times_[i] <= times_[i - 1]) {
      throw std::invalid_argument(where + "time " + std::to_string(point.time_s) +
                                  " s is not after the time before it");
    }
  }
  findVelocities();
}

void WaypointPath::findVelocities() {
  velocities_.assign(points_.size(), Vec3::Zero());
  for (std::size_t i = 1; i + 1 < points_.size(); ++i) {
    const double before_s = base::toSeconds(times_[i] - times_[i - 1]);
    const double after_s = base::toSeconds(times_[i + 1] - times_[i]);
    const Vec3 before = (points_[i].position_m - points_[i - 1].position_m) / before_s;
    const Vec3 after = (points_[i + 1].position_m - points_[i].position_m) / after_s;
    for (int axis = 0; axis < 3; ++axis) {
      velocities_[i][axis] = slope(before[axis], after[axis], before_s, after_s);
    }
  }
}

HandPose WaypointPath::at(Nanos sinceStart) const noexcept {
  Nanos t = times_.front() + std::max<Nanos>(sinceStart, 0);
  if (repeat_ && duration() > 0) t = times_.front() + std::max<Nanos>(sinceStart, 0) % duration();

  const auto next = std::upper_bound(times_.begin(), times_.end(), t);
  if (next == times_.end()) {
    const Waypoint& last = points_.back();
    return {last.position_m, Vec3::Zero(), last.orientation, last.buttons};
  }
  const auto i = static_cast<std::size_t>(next - times_.begin()) - 1;
  const Waypoint& a = points_[i];
  const Waypoint& b = points_[i + 1];
  const double h = base::toSeconds(times_[i + 1] - times_[i]);
  const double s = base::toSeconds(t - times_[i]) / h;
  const double eased = s * s * (3 - 2 * s);
  const Vec3 way = b.position_m - a.position_m;
  const Vec3 va = h * velocities_[i];
  const Vec3 vb = h * velocities_[i + 1];
  HandPose pose;
  pose.position_m = a.position_m + eased * way + s * (1 - s) * ((1 - s) * va - s * vb);
  pose.velocity_m_per_s = (6 * s * (1 - s) * way + (1 - s) * (1 - 3 * s) * va + s * (3 * s - 2) * vb) / h;
  pose.orientation = a.orientation.slerp(eased, b.orientation);
  pose.buttons = a.buttons;
  return pose;
}

}  // namespace hapticd::device

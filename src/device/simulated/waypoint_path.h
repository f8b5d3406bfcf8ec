// A hand that passes given points at given times, smoothly.
#pragma once

#include <limits>
#include <vector>

#include "device/simulated/hand_path.h"

namespace hapticd::device {

/// A point of a path. Device frame, metres.
struct Waypoint {
  double time_s = 0;
  Vec3 position_m = Vec3::Zero();
  Quat orientation = Quat::Identity();
  std::uint32_t buttons = 0;  ///< from here to the next point
};

/// Cubic between the points with a continuous velocity, at rest at both ends; no coordinate leaves the range
/// of the two points around it (Fritsch & Butland 1984). Orientation by eased slerp.
class WaypointPath final : public HandPath {
 public:
  enum class Repeat { no, yes };

  /// Throws std::invalid_argument when there is no point, a value is not finite or times do not increase.
  /// A path that repeats should end where it starts.
  explicit WaypointPath(std::vector<Waypoint> points, Repeat repeat = Repeat::no,
                        double strength_N = std::numeric_limits<double>::infinity());

  HandPose at(Nanos sinceStart) const noexcept override;
  Nanos duration() const noexcept override { return times_.back() - times_.front(); }
  double strength_N() const noexcept override { return strength_N_; }

 private:
  void findVelocities();

  std::vector<Waypoint> points_;
  std::vector<Nanos> times_;
  std::vector<Vec3> velocities_;
  bool repeat_;
  double strength_N_;
};

}  // namespace hapticd::device

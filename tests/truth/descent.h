// How near to its goal a ball could come that rolls there by hand, in small moves that pass no face and never
// lead away: the judge of a proxy that rests. It needs no topology: directions are the pull, its projections
// on the faces nearby and on the grooves of two, and random ones.
#pragma once

#include <random>

#include "truth/reference.h"

namespace hapticd::truth {

inline constexpr double kLongestStep_m = 1e-4;

class Descent {
 public:
  /// `slack_m`: by which a ball may overlap a face; it may climb by half of that.
  Descent(const Reference& reference, const Point& centre, double reach, double radius_m, std::uint64_t seed,
          double slack_m = 2e-9);

  /// A place that is nearer to the goal than `start`, or that. What is narrower than a sixtieth of a step is
  /// jumped over; `first_m`: of the first one.
  Point from(const Point& start, const Point& goal, int steps = 40, double first_m = kLongestStep_m);

 private:
  Point step(const Point& x, const Point& goal, double length);
  bool rolls(const Point& x, const Point& end, const Point& goal) const;
  bool passesNone(const Point& p, const Point& q) const;
  bool pushedOut(Point& x) const;
  Point randomDirection();

  const Reference& reference_;
  double reach_;
  double radius_;
  double slack_;
  std::vector<int> faces_;
  std::mt19937_64 random_;
};

}  // namespace hapticd::truth

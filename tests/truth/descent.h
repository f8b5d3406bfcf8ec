// How near to its goal a ball could come that rolls there by hand, in small moves that pass no face and never
// lead away: the judge of a proxy that rests. It needs no topology: directions are the pull, its projections
// on the faces nearby, and random ones.
#pragma once

#include <random>

#include "truth/reference.h"

namespace hapticd::truth {

class Descent {
 public:
  Descent(const Reference& reference, const Point& centre, double reach, double radius_m, std::uint64_t seed);

  /// A place that is nearer to the goal than `start`, or that.
  Point from(const Point& start, const Point& goal);

 private:
  Point step(const Point& x, const Point& goal, double length);
  bool rolls(const Point& x, const Point& end, const Point& goal) const;
  bool passesNone(const Point& p, const Point& q) const;
  bool pushedOut(Point& x) const;
  Point randomDirection();

  const Reference& reference_;
  double reach_;
  double radius_;
  std::vector<int> faces_;
  std::mt19937_64 random_;
};

}  // namespace hapticd::truth

// How near to its goal a tool could come that is drawn there by hand, in small moves that cross no face: the
// judge of a proxy that rests. It needs no topology: directions are the pull, its projections on the faces
// and edges nearby, and random ones.
#pragma once

#include <random>

#include "truth/reference.h"

namespace hapticd::truth {

class Descent {
 public:
  /// `widening`: faces are widened by it, so that gaps narrower than twice that are closed.
  Descent(const Reference& reference, const Point& centre, double reach, double toolRadius_m, double widening,
          std::uint64_t seed);

  /// A place nearer to the goal than `start`, reached in moves that only ever come nearer.
  Point from(const Point& start, const Point& goal);

 private:
  Point stepOfPoint(const Point& x, const Point& goal);
  Point stepOfBall(const Point& x, const Point& goal, double length);
  bool rolls(const Point& x, const Point& end, const Point& goal) const;
  double freeShare(const Point& p, const Point& way) const;
  bool pushedOut(Point& x) const;
  Point normalAt(const Face& f, const Point& x) const;
  Point randomDirection();

  const Reference& reference_;
  double reach_;
  double radius_;
  double widening_;
  double touch_;
  std::vector<int> faces_;
  std::mt19937_64 random_;
};

}  // namespace hapticd::truth

#include "truth/descent.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace hapticd::truth {
namespace {

constexpr double kShortest_m = 2e-8;  // a shorter way leads nowhere
constexpr double kSlack_m = 2e-9;     // by which a ball may overlap a face
constexpr double kClimb_m = 1e-9;     // by which a rolling ball may climb
constexpr int kSteps = 40;
constexpr int kRollSteps = 64;

}  // namespace

Descent::Descent(const Reference& reference, const Point& centre, double reach, double toolRadius_m,
                 double widening, std::uint64_t seed)
    : reference_(reference),
      reach_(reach),
      radius_(toolRadius_m),
      widening_(widening),
      touch_(std::max(2e-8, 8e-9 * reference.extent())),
      faces_(reference.near(centre, reach + toolRadius_m + 2 * widening)),
      random_(seed) {}

Point Descent::randomDirection() {
  std::normal_distribution<double> normal;
  return Point(normal(random_), normal(random_), normal(random_)).normalized();
}

// Towards the tool, as the face would push it.
Point Descent::normalAt(const Face& f, const Point& x) const {
  if (radius_ > 0) return (x - nearestOf(f, x)).stableNormalized();
  return f.normal.dot(x - f.a) < 0 ? Point(-f.normal) : f.normal;
}

// The share, 0 … 1, of a way of the tool's centre that is free, a little off what ends it.
double Descent::freeShare(const Point& p, const Point& way) const {
  double free = 1;
  for (const int i : faces_) {
    const Face& f = reference_.face(i);
    if (!reference_.crosses(i, p, p + way, widening_)) continue;
    const double start = std::abs(f.normal.dot(p - f.a));
    const double fall = std::abs(f.normal.dot(way));
    free = std::min(free, std::max(0.0, (start - 0.5 * touch_) / fall));
  }
  return free;
}

Point Descent::stepOfPoint(const Point& x, const Point& goal) {
  const Point pull = goal - x;
  std::vector<Point> ways{pull};
  Point out = Point::Zero();
  for (const int i : faces_) {
    const Face& f = reference_.face(i);
    const Point foot = nearestOf(f, x);
    if ((foot - x).norm() > touch_ || !reference_.touchableFrom(f, f.normal.dot(x - f.a))) continue;
    const Point n = normalAt(f, x);
    out += n;
    ways.push_back(pull - n * n.dot(pull));
    const std::array<Point, 3> corners{f.a, f.b, f.c};
    for (std::size_t k = 0; k < 3 && !f.unbounded; ++k) {
      const Point edge = (corners[(k + 1) % 3] - corners[k]).stableNormalized();
      if (edge.cross(x - corners[k]).norm() <= touch_) ways.push_back(edge * edge.dot(pull));
    }
  }
  for (int i = 0; i < 6; ++i) {
    const Point d = randomDirection();
    ways.push_back(d * d.dot(pull));
  }
  out = out.stableNormalized();
  Point best = x;
  for (const double lift : {0.0, 2 * touch_, 20 * touch_}) {
    const Point start = x + lift * out;
    if (lift > 0 && freeShare(x, start - x) < 1) continue;
    for (const Point& way : ways) {
      if (way.norm() < kShortest_m) continue;
      const Point limited = way * std::min(1.0, reach_ / way.norm());
      const Point end = start + freeShare(start, limited) * limited;
      if ((goal - end).norm() < (goal - best).norm()) best = end;
    }
  }
  return best;
}

// Moves the centre of a ball off the faces that it overlaps.
bool Descent::pushedOut(Point& x) const {
  for (int k = 0; k < 40; ++k) {
    double nearest = radius_ - kSlack_m;
    Point away = Point::Zero();
    for (const int i : faces_) {
      const Face& f = reference_.face(i);
      if (!reference_.touchableFrom(f, f.normal.dot(x - f.a))) continue;
      const Point from = x - nearestOf(f, x);
      if (!(from.norm() < nearest)) continue;
      nearest = from.norm();
      away = from.stableNormalized();
    }
    if (away.isZero(0)) return true;
    x += (radius_ - nearest) * away;
  }
  return false;
}

// Whether the ball gets from x to `end` without a climb: three edges may hold it that a straight step jumps
// over.
bool Descent::rolls(const Point& x, const Point& end, const Point& goal) const {
  Point before = x;
  for (int k = 1; k <= kRollSteps; ++k) {
    Point next = x + static_cast<double>(k) / kRollSteps * (end - x);
    if (!pushedOut(next) || freeShare(before, next - before) < 1) return false;
    if ((next - before).norm() > 4 * (end - x).norm() / kRollSteps) return false;
    if ((goal - next).norm() > (goal - x).norm() + kClimb_m) return false;
    before = next;
  }
  return true;
}

// The free space of a ball has round faces: a step along them, then out of them.
Point Descent::stepOfBall(const Point& x, const Point& goal, double length) {
  const Point pull = goal - x;
  std::vector<Point> ways{pull};
  for (const int i : faces_) {
    const Face& f = reference_.face(i);
    if ((x - nearestOf(f, x)).norm() > radius_ + 1e-6) continue;
    const Point n = normalAt(f, x);
    ways.push_back(pull - n * n.dot(pull));
    if (ways.size() > 12) break;
  }
  for (int i = 0; i < 4; ++i) ways.push_back(randomDirection());
  for (const Point& way : ways) {
    if (way.norm() < kShortest_m || way.dot(pull) <= 0) continue;
    Point end = x + way * std::min(1.0, length / way.norm());
    if (!pushedOut(end) || !((goal - end).norm() < (goal - x).norm() - 1e-9)) continue;
    if (rolls(x, end, goal)) return end;
  }
  return x;
}

Point Descent::from(const Point& start, const Point& goal) {
  Point x = start;
  double length = 1e-4;
  for (int i = 0; i < kSteps && (x - start).norm() < 0.5 * reach_; ++i) {
    const Point next =
        radius_ > 0 ? stepOfBall(x, goal, std::min(length, 0.25 * reach_)) : stepOfPoint(x, goal);
    if (next == x) {
      length *= 0.3;
      if (radius_ == 0 || length < 1e-6) break;
    }
    x = next;
  }
  return x;
}

}  // namespace hapticd::truth

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

Descent::Descent(const Reference& reference, const Point& centre, double reach, double radius_m,
                 std::uint64_t seed)
    : reference_(reference),
      reach_(reach),
      radius_(radius_m),
      faces_(reference.near(centre, reach + radius_m)),
      random_(seed) {}

Point Descent::randomDirection() {
  std::normal_distribution<double> normal;
  return Point(normal(random_), normal(random_), normal(random_)).normalized();
}

// Whether a way of the ball's centre passes no face.
bool Descent::passesNone(const Point& p, const Point& q) const {
  return std::none_of(faces_.begin(), faces_.end(), [&](int i) { return reference_.crosses(i, p, q, 0); });
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
    if (!pushedOut(next) || !passesNone(before, next)) return false;
    if ((next - before).norm() > 2 * (end - x).norm() / kRollSteps) return false;
    if ((goal - next).norm() > (goal - x).norm() + kClimb_m) return false;
    before = next;
  }
  return true;
}

// The free space of a ball has round faces: a step along them, then out of them.
Point Descent::step(const Point& x, const Point& goal, double length) {
  const Point pull = goal - x;
  std::vector<Point> ways{pull};
  for (const int i : faces_) {
    const Face& f = reference_.face(i);
    if ((x - nearestOf(f, x)).norm() > radius_ + 1e-6) continue;
    const Point n = (x - nearestOf(f, x)).stableNormalized();
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
  if (!pushedOut(x)) return start;
  double length = 1e-4;
  for (int i = 0; i < kSteps && (x - start).norm() < 0.5 * reach_; ++i) {
    const Point next = step(x, goal, std::min(length, 0.25 * reach_));
    if (next == x) {
      length *= 0.3;
      if (length < 1e-6) break;
    }
    x = next;
  }
  return x;
}

}  // namespace hapticd::truth

#include "truth/descent.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace hapticd::truth {
namespace {

constexpr double kShortest_m = 2e-8;  // a shorter way leads nowhere
constexpr int kRollSteps = 64;
// In slacks, how far a step may rise above its start, and above its lowest place: a ball that is pushed out
// of several faces is not moved evenly.
constexpr double kClimb = 0.5;
constexpr double kUneven = 10;
constexpr std::size_t kGrooves = 4;  // of this many faces

}  // namespace

Descent::Descent(const Reference& reference, const Point& centre, double reach, double radius_m,
                 std::uint64_t seed, double slack_m)
    : reference_(reference),
      reach_(reach),
      radius_(radius_m),
      slack_(slack_m),
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
    double nearest = radius_ - slack_;
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
  double lowest = (goal - x).norm();
  for (int k = 1; k <= kRollSteps; ++k) {
    Point next = x + static_cast<double>(k) / kRollSteps * (end - x);
    if (!pushedOut(next) || !passesNone(before, next)) return false;
    if ((next - before).norm() > 2 * (end - x).norm() / kRollSteps) return false;
    const double height = (goal - next).norm();
    if (height > std::min((goal - x).norm() + kClimb * slack_, lowest + kUneven * slack_)) return false;
    lowest = std::min(lowest, height);
    before = next;
  }
  return true;
}

// The free space of a ball has round faces: a step along one of them, or along two, then out of them.
Point Descent::step(const Point& x, const Point& goal, double length) {
  const Point pull = goal - x;
  std::vector<Point> normals;
  for (const int i : faces_) {
    const Face& f = reference_.face(i);
    if ((x - nearestOf(f, x)).norm() > radius_ + 1e-6) continue;
    normals.push_back((x - nearestOf(f, x)).stableNormalized());
    if (normals.size() > 11) break;
  }
  std::vector<Point> ways{pull};
  for (const Point& n : normals) ways.push_back(pull - n * n.dot(pull));
  for (std::size_t i = 0; i < std::min(normals.size(), kGrooves); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const Point along = normals[i].cross(normals[k]).stableNormalized();
      ways.push_back(along * along.dot(pull));
    }
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

Point Descent::from(const Point& start, const Point& goal, int steps, double first_m) {
  Point x = start;
  if (!pushedOut(x)) return start;
  double length = first_m;
  for (int i = 0; i < steps && (x - start).norm() < 0.5 * reach_; ++i) {
    const Point next = step(x, goal, std::min(length, 0.25 * reach_));
    length = next == x ? 0.3 * length : std::min(2 * length, kLongestStep_m);
    if (length < std::min(1e-6, 0.05 * first_m)) break;
    x = next;
  }
  return x;
}

}  // namespace hapticd::truth

#include "truth/free_space.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace hapticd::truth {
namespace {

constexpr int kTreeNodes = 8000;

}  // namespace

FreeSpace::FreeSpace(const Reference& reference, const Point& centre, double reach, double ballRadius,
                     std::uint64_t seed, bool overlapping)
    : reference_(reference),
      centre_(centre),
      reach_(reach),
      radius_(ballRadius),
      overlapping_(overlapping),
      random_(seed) {
  for (const int i : reference.near(centre, 2 * reach + 2 * ballRadius)) {
    if (!reference.faces()[static_cast<std::size_t>(i)].thin) faces_.push_back(i);
  }
}

bool FreeSpace::clear(const Point& p, const Point& q) const {
  return std::all_of(faces_.begin(), faces_.end(), [&](int i) {
    const Face& f = reference_.faces()[static_cast<std::size_t>(i)];
    const double start = f.normal.dot(p - f.a);
    const double end = f.normal.dot(q - f.a);
    if (std::min(start, end) > radius_ || std::max(start, end) < -radius_ ||
        !reference_.touchableFrom(f, start))
      return true;
    return distanceOf(f, p, q) >= radius_ || risesFrom(f, p, start, end);
  });
}

// Off a one-sided face that it overlaps, because it came from behind.
bool FreeSpace::risesFrom(const Face& f, const Point& p, double start, double end) const {
  if (!overlapping_ || f.unbounded || reference_.touchableFrom(f, -1) == reference_.touchableFrom(f, 1))
    return false;
  const bool rises = reference_.touchableFrom(f, 1) ? end >= start : end <= start;
  return rises && (nearestOf(f, p) - p).norm() < radius_;
}

Point FreeSpace::direction() {
  std::normal_distribution<double> normal;
  return Point(normal(random_), normal(random_), normal(random_)).normalized();
}

// Where edges go past other faces: the way around such an edge may lead through the groove of the two, which
// is too narrow to be found by chance. The shortest detours come first.
void FreeSpace::findCrossings(const Point& p, const Point& q) {
  crossings_.clear();
  for (const int i : faces_) {
    const Face& f = reference_.faces()[static_cast<std::size_t>(i)];
    if (f.unbounded) continue;
    const std::array<Point, 3> corners{f.a, f.b, f.c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Point edge = corners[(k + 1) % 3] - corners[k];
      for (const int j : faces_) {
        const Face& other = reference_.faces()[static_cast<std::size_t>(j)];
        const double slope = other.normal.dot(edge);
        const double t = slope != 0 ? other.normal.dot(other.a - corners[k]) / slope : -1.0;
        const Point crossing = corners[k] + t * edge;
        if (t >= 0 && t <= 1 && (crossing - centre_).norm() <= reach_ &&
            (nearestOf(other, crossing) - crossing).norm() <= radius_)
          crossings_.push_back(crossing);
      }
    }
  }
  const auto detour = [&](const Point& x) { return (x - p).norm() + (q - x).norm(); };
  std::sort(crossings_.begin(), crossings_.end(),
            [&](const Point& a, const Point& b) { return detour(a) < detour(b); });
}

// In the ball of all paths, half of them at edges, where ways around lead.
Point FreeSpace::sample() {
  std::uniform_real_distribution<double> uniform(0, 1);
  if (!crossings_.empty() && uniform(random_) < 0.2) {
    const double rank = std::pow(uniform(random_), 3);
    const Point& crossing =
        crossings_[static_cast<std::size_t>(rank * static_cast<double>(crossings_.size()))];
    return crossing + radius_ * (1.02 + 6 * uniform(random_) * uniform(random_)) * direction();
  }
  if (!faces_.empty() && uniform(random_) < 0.5) {
    const Face& f = reference_.faces()[static_cast<std::size_t>(faces_[random_() % faces_.size()])];
    const std::array<Point, 3> corners{f.a, f.b, f.c};
    const std::size_t k = random_() % 3;
    const Point e = corners[(k + 1) % 3] - corners[k];
    // Around the part of the edge that is near.
    const double length = e.norm();
    const double middle = length > 0 ? e.dot(centre_ - corners[k]) / (length * length) : 0.0;
    const double half = length > 0 ? reach_ / length : 0.0;
    const double t = std::clamp(middle + half * (2 * uniform(random_) - 1), 0.0, 1.0);
    return corners[k] + t * e + radius_ * (1.02 + 3 * uniform(random_) * uniform(random_)) * direction();
  }
  return centre_ + reach_ * std::cbrt(uniform(random_)) * direction();
}

// Away from the faces at p: all together, then each.
std::vector<Point> FreeSpace::outward(const Point& p) const {
  std::vector<Point> found{Point::Zero(), Point::Zero()};
  for (const int i : faces_) {
    const Face& f = reference_.faces()[static_cast<std::size_t>(i)];
    const double distance = (nearestOf(f, p) - p).norm();
    if (distance > 10 * radius_) continue;
    const double height = f.normal.dot(p - f.a);
    if (!reference_.touchableFrom(f, height)) continue;
    const Point away = height < 0 ? Point(-f.normal) : f.normal;
    found[1] += away;
    if (distance > 0.5 * radius_) continue;
    found[0] += away;
    if (found.size() < 20) found.push_back(away);
  }
  for (Point& d : found) d = d.norm() > 1e-9 ? Point(d.normalized()) : Point(Point::UnitX());
  return found;
}

std::optional<Point> FreeSpace::placeNear(const Point& p, const std::function<bool(const Point&)>& visible) {
  if (clear(p, p)) return p;
  const std::vector<Point> found = placesNear(p, visible, 1);
  return found.empty() ? std::nullopt : std::optional(found.front());
}

std::vector<Point> FreeSpace::placesNear(const Point& p, const std::function<bool(const Point&)>& visible,
                                         std::size_t most) {
  if (!overlapping_ && clear(p, p) && visible(p)) return {p};
  std::vector<Point> found;
  std::vector<Point> directions = outward(p);
  for (int i = 0; i < 60; ++i) directions.push_back(direction());
  for (double distance = 1.1 * radius_; distance <= reach_; distance *= 2) {
    for (const Point& d : directions) {
      const Point q = p + distance * d;
      if (!clear(q, q) || !visible(q)) continue;
      found.push_back(q);
      if (found.size() == most) return found;
    }
  }
  return found;
}

bool FreeSpace::connectsByOneBend(const Point& p, const Point& q) {
  std::vector<Point> directions = outward(p);
  const std::vector<Point> atEnd = outward(q);
  directions.push_back((directions[0] + atEnd[0]).stableNormalized());
  directions.insert(directions.end(), atEnd.begin(), atEnd.end());
  for (int i = 0; i < 10; ++i) directions.push_back(direction());
  const double length = (q - p).norm() + 2 * radius_;
  for (const double share : {0.3, 1.0}) {
    for (const Point& d : directions) {
      for (const Point& from : {Point(0.5 * (p + q)), p, q}) {
        const Point bend = from + share * length * d;
        if (clear(p, bend) && clear(bend, q)) return true;
      }
    }
  }
  return false;
}

// Two trees of free segments that grow towards random places until they meet (Kuffner & LaValle 2000).
bool FreeSpace::connectsByTrees(const Point& p, const Point& q) {
  findCrossings(p, q);
  std::vector<Node> nodes{{p, 0}, {q, 1}};
  const auto nearestIn = [&](int tree, const Point& x) {
    const Node* nearest = nullptr;
    for (const Node& n : nodes) {
      if (n.tree == tree &&
          (nearest == nullptr || (n.at - x).squaredNorm() < (nearest->at - x).squaredNorm()))
        nearest = &n;
    }
    return nearest->at;
  };
  // The second tree ends at q: its paths are walked towards it. One-sided faces tell the difference.
  const auto free = [&](int tree, const Point& from, const Point& to) {
    return tree == 0 ? clear(from, to) : clear(to, from);
  };
  const auto extended = [&](int tree, const Point& from, const Point& to) {
    for (const double share : {1.0, 0.4, 0.1}) {
      const Point x = from + share * (to - from);
      if (free(tree, from, x)) return x;
    }
    return from;
  };
  for (int i = 0; i < kTreeNodes; ++i) {
    const int tree = i % 2;
    const Point goal = i % 8 < 2 ? nodes[static_cast<std::size_t>(1 - tree)].at : sample();
    if ((goal - centre_).norm() > reach_) continue;
    const Point from = nearestIn(tree, goal);
    const Point x = extended(tree, from, goal);
    if (x == from) continue;
    nodes.push_back({x, tree});
    if (free(tree, x, nearestIn(1 - tree, x))) return true;
  }
  return false;
}

}  // namespace hapticd::truth

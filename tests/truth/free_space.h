// Whether two points are in the same part of the space that a small ball can reach: gaps narrower than the
// ball join nothing.
#pragma once

#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "truth/reference.h"

namespace hapticd::truth {

/// The free space of a ball around one place.
class FreeSpace {
 public:
  /// `reach`: of all paths, around `centre`. With `overlapping`, a ball that came from behind a one-sided
  /// face may overlap it, as long as it does not go back.
  FreeSpace(const Reference& reference, const Point& centre, double reach, double ballRadius,
            std::uint64_t seed, bool overlapping = false);

  /// A path free of faces, as far from each as the ball's radius.
  bool clear(const Point& p, const Point& q) const;
  /// A place for the ball near p, to which `visible(place)` holds.
  std::optional<Point> placeNear(const Point& p, const std::function<bool(const Point&)>& visible);
  /// Up to `most` of those, the nearest first. p itself must be visible, too.
  std::vector<Point> placesNear(const Point& p, const std::function<bool(const Point&)>& visible,
                                std::size_t most);
  /// Whether a path leads from p to q, both places for the ball.
  bool connects(const Point& p, const Point& q) { return connectsSimply(p, q) || connectsByTrees(p, q); }
  /// The same for a path with one bend at most.
  bool connectsSimply(const Point& p, const Point& q) { return clear(p, q) || connectsByOneBend(p, q); }

  const std::vector<int>& faces() const { return faces_; }

 private:
  struct Node {
    Point at;
    int tree;  // 0: of the start, 1: of the end
  };
  bool risesFrom(const Face& f, const Point& p, double start, double end) const;
  Point sample();
  Point direction();
  std::vector<Point> outward(const Point& p) const;
  bool connectsByOneBend(const Point& p, const Point& q);
  void findCrossings(const Point& p, const Point& q);
  bool connectsByTrees(const Point& p, const Point& q);

  const Reference& reference_;
  Point centre_;
  double reach_;
  double radius_;
  bool overlapping_;
  std::vector<int> faces_;
  std::vector<Point> crossings_;
  std::mt19937_64 random_;
};

}  // namespace hapticd::truth

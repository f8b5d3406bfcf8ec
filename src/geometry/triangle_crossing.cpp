#include "geometry/triangle_crossing.h"

#include <algorithm>

namespace hapticd::geometry {
namespace {

using Signs = std::array<int, 3>;

bool onBothSides(const Signs& signs) noexcept {
  return std::min({signs[0], signs[1], signs[2]}) < 0 && std::max({signs[0], signs[1], signs[2]}) > 0;
}

// On which side of the plane of b each corner of a lies.
Signs sides(const Corners3f& a, const Corners3f& b, ExactCount& exact) noexcept {
  Signs signs;
  for (std::size_t i = 0; i < 3; ++i) signs[i] = orientation(b[0], b[1], b[2], a[i], exact);
  return signs;
}

// The corner that is alone on its side.
std::size_t loneCorner(const Signs& signs) noexcept {
  for (std::size_t i = 0; i < 2; ++i) {
    if (signs[i] != 0 && signs[i] != signs[(i + 1) % 3] && signs[i] != signs[(i + 2) % 3]) return i;
  }
  return 2;
}

// Whether the line through an edge of a separates both interiors, seen along an axis.
bool separates(int axis, int turn, const Corners3f& a, const Corners3f& b, ExactCount& exact) noexcept {
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3f& from = a[i];
    const Vec3f& to = a[(i + 1) % 3];
    if (std::all_of(b.begin(), b.end(), [&](const Vec3f& corner) {
          return turn * orientationAlong(axis, from, to, corner, exact) <= 0;
        })) {
      return true;
    }
  }
  return false;
}

bool crossInPlane(const Corners3f& a, const Corners3f& b, ExactCount& exact) noexcept {
  for (int axis = 0; axis < 3; ++axis) {
    const int turnOfA = orientationAlong(axis, a[0], a[1], a[2], exact);
    const int turnOfB = orientationAlong(axis, b[0], b[1], b[2], exact);
    if (turnOfA == 0 || turnOfB == 0) continue;
    return !separates(axis, turnOfA, a, b, exact) && !separates(axis, turnOfB, b, a, exact);
  }
  return false;
}

}  // namespace

// Each triangle intersects the line common to both planes in a segment between the two edges at its lone
// corner. The orientation of two such edges, one of each triangle, orders their intersections along the line,
// always in the same direction; the segments overlap unless one lies entirely before the other.
bool cross(const Corners3f& a, const Corners3f& b, ExactCount& exact) noexcept {
  const Signs sidesOfA = sides(a, b, exact);
  if (sidesOfA == Signs{0, 0, 0}) return crossInPlane(a, b, exact);
  if (!onBothSides(sidesOfA)) return false;
  const Signs sidesOfB = sides(b, a, exact);
  if (!onBothSides(sidesOfB)) return false;
  const std::size_t i = loneCorner(sidesOfA);
  const std::size_t j = loneCorner(sidesOfB);
  bool before = false;
  bool behind = false;
  for (const std::size_t m : {(i + 1) % 3, (i + 2) % 3}) {
    for (const std::size_t n : {(j + 1) % 3, (j + 2) % 3}) {
      const int order = orientation(a[i], a[m], b[j], b[n], exact);
      before = before || order < 0;
      behind = behind || order > 0;
    }
  }
  return before && behind;
}

}  // namespace hapticd::geometry

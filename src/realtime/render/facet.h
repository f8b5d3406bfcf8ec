// One triangle in device metres, and casts of a ball against it.
//
// A standoff keeps the centre off a face: the radius of the ball plus `skin`, a length far above the rounding
// error of all computations here and far below what can be felt. So no sign is decided near its own rounding
// error.
#pragma once

#include <array>
#include <cstdint>

#include "realtime/render/active_set.h"
#include "scene/mesh_geometry.h"
#include "scene/surface.h"

namespace hapticd::realtime {

/// A valid triangle from makeFacet(), or a plane.
struct Facet {
  Vec3 a = Vec3::Zero();  ///< corners counter-clockwise from the front; a-b is the longest edge
  Vec3 b = Vec3::Zero();
  Vec3 c = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  ///< unit, out of the front
  std::array<Vec3, 3> outward{
      Vec3::Zero(), Vec3::Zero(),
      Vec3::Zero()};  ///< of the sides a-b, b-c and c-a, in the plane, each as long as its side
  double extent = 0;  ///< greatest distance of a corner from the middle of a-b
  double skin = 0;
  double radius = 0;  ///< of the ball that touches it
  std::uint32_t triangle = 0;
  int object = 0;          ///< index of the near object; negative for a plane of the scene
  bool unbounded = false;  ///< a plane: no edges, touchable from the front only
};

/// Where a facet blocks a path: at parameter `stop` in [0, 1] the proxy is at its standoff, on `halfSpace`.
struct CastHit {
  double stop = 0;
  double depth = 0;  ///< of the end of the path below the half-space; orders equal stops
  HalfSpace halfSpace;
  bool atEdge = false;  ///< beside the face: the half-space touches the ball, not the face
};

/// False for triangles that are not finite or thinner than the skin: their neighbours are nearer than a ball
/// is wide.
bool makeFacet(const scene::Corners& corners, double skin, Facet& facet) noexcept;

/// Whether the facet may block paths that begin at p: not from behind a side that can not be touched.
bool isTouchable(const Facet& f, scene::TouchableFaces faces, const Vec3& p) noexcept;

/// Where the facet blocks the centre's path p + t d, t in [0, limit]. False when it does not, or only beyond
/// `latest`.
bool castBall(const Facet& f, scene::TouchableFaces faces, const Vec3& p, const Vec3& d, double limit,
              double latest, CastHit& out) noexcept;

/// The same for a point and a face that reaches `widening` beyond its edges; `stop` is at the skin.
bool castPoint(const Facet& f, scene::TouchableFaces faces, const Vec3& p, const Vec3& d, double widening,
               double& stop) noexcept;

/// The disc around a triangle.
struct Disc {
  Vec3 centre = Vec3::Zero();
  double radius = 0;
  Vec3 normal = Vec3::Zero();  ///< unit; zero for a needle, whose normal is not reliable: then it is a ball
};
Disc discAround(const scene::Corners& corners) noexcept;

/// The distance of x from it: a lower bound of that from the triangle.
double distanceFrom(const Disc& disc, const Vec3& x) noexcept;

/// The point of the triangle nearest to x (Ericson 2005, 5.1.5).
Vec3 nearestPointOf(const Facet& f, const Vec3& x) noexcept;

}  // namespace hapticd::realtime

// One triangle in device metres, and the questions the proxy asks of it.
//
// The proxy is kept off a face by the facet's standoff: the tool radius plus `skin`, a length far above the
// rounding error of all that is computed here and far below what a hand can feel. No sign is then ever
// decided near its own rounding error. For the test itself a face is widened by a quarter of the skin, so
// that neighbours overlap and rounding opens no gap between them; the proxy passes an edge at more than that
// height, so that the overlap never catches it.
#pragma once

#include <cstdint>

#include "realtime/render/active_set.h"
#include "scene/mesh_geometry.h"
#include "scene/surface.h"

namespace hapticd::realtime {

/// A sound triangle, made by makeFacet, or a whole plane.
struct Facet {
  Vec3 a = Vec3::Zero();  ///< corners counter-clockwise from the front; a-b is the longest edge
  Vec3 b = Vec3::Zero();
  Vec3 c = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  ///< unit, out of the front
  double skin = 0;
  std::uint32_t triangle = 0;
  int object = 0;          ///< position among the near objects; negative for a plane of the scene
  bool unbounded = false;  ///< a plane: no edges, felt from the front
};

/// Where a path meets a facet: at `stop` in [0, 1] the proxy is at its standoff; `plane` keeps it there.
struct CastHit {
  double stop = 0;
  double depth = 0;  ///< how far the path would go on below the plane; decides between equal stops
  HalfSpace halfSpace;
};

/// False for triangles too thin to matter (thinner than the skin, hence covered by their neighbours' margin)
/// or not finite.
bool makeFacet(const scene::Corners& corners, double skin, Facet& facet) noexcept;

/// The point tool: first parameter in [0, limit] at which the path p + t d comes to the facet itself, or ends
/// within half a skin of it; > 1 when it passes.
double crossingParameter(const Facet& f, scene::TouchableFaces faces, const Vec3& p, const Vec3& d,
             double limit) noexcept;

/// The point tool: where the path p + t d, t in [0, limit], has to stop for this facet. False when it passes.
bool castPoint(const Facet& f, scene::TouchableFaces faces, const Vec3& p, const Vec3& d, double limit,
          CastHit& out) noexcept;

/// The ball tool: where its centre has to stop on the path p + t d, t in [0, limit]; a stop beyond `latest`
/// is of no interest. False when it passes.
bool castBall(const Facet& f, scene::TouchableFaces faces, double radius, const Vec3& p, const Vec3& d,
              double limit, double latest, CastHit& out) noexcept;

/// A lower bound of the distance of x from a triangle: that from the disc around it.
double distanceBound(const scene::Corners& corners, const Vec3& x) noexcept;

/// The point of the triangle nearest to x (Ericson 2005, 5.1.5).
Vec3 nearestPointOf(const Facet& f, const Vec3& x) noexcept;

}  // namespace hapticd::realtime

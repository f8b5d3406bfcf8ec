// What is wrong with a mesh, counted, and what rendering makes of it.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

/// Counts of what a mesh should not have. Corners at equal positions count as one vertex.
struct MeshReport {
  std::size_t triangles = 0;
  std::size_t incomplete = 0;    ///< triangles with a corner that is missing or not finite
  std::size_t degenerate = 0;    ///< triangles without area
  std::size_t duplicate = 0;     ///< triangles with the corners of an earlier one
  std::size_t unwelded = 0;      ///< vertices at the place of an earlier one; 0 for plain triples
  std::size_t openEdges = 0;     ///< edges of one triangle only
  std::size_t crowdedEdges = 0;  ///< edges of more than two triangles
  std::size_t flippedEdges = 0;  ///< edges whose two triangles disagree which side is the front
  bool insideOut = false;        ///< closed, and its front looks inwards

  bool closed() const { return openEdges == 0 && crowdedEdges == 0 && triangles > incomplete + degenerate; }
  bool clean() const;
};

/// Whether a triangle is more than a line, as far as floats can tell. False when a coordinate is not finite.
bool hasArea(const Vec3f& a, const Vec3f& b, const Vec3f& c);

/// Looks at every triangle, in time linear in their number; a second is enough for a few million. Below 2^31
/// vertices.
MeshReport checkMesh(std::span<const Vec3f> vertices, std::span<const Triangle> triangles);

/// One plain sentence for each finding, with what it means for touching; none for a clean mesh.
std::vector<std::string> describe(const MeshReport& report);

}  // namespace hapticd::geometry

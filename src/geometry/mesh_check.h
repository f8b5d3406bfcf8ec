// Defects of a mesh, counted, and their effect on rendering.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

/// Counts of defects. Corners at equal positions count as one vertex.
struct MeshReport {
  std::size_t triangles = 0;
  std::size_t incomplete = 0;    ///< triangles with a missing or non-finite corner
  std::size_t degenerate = 0;    ///< triangles without area
  std::size_t duplicate = 0;     ///< triangles with the same corners as an earlier one
  std::size_t unwelded = 0;      ///< vertices at the position of an earlier one; 0 for unindexed triples
  std::size_t openEdges = 0;     ///< edges of only one triangle
  std::size_t crowdedEdges = 0;  ///< edges of more than two triangles
  std::size_t flippedEdges = 0;  ///< edges whose two triangles have opposite fronts
  bool insideOut = false;        ///< closed, with fronts that face inwards

  bool closed() const { return openEdges == 0 && crowdedEdges == 0 && triangles > incomplete + degenerate; }
  bool clean() const;
};

/// Whether a triangle has area beyond float rounding. False when a coordinate is not finite.
bool hasArea(const Vec3f& a, const Vec3f& b, const Vec3f& c);

/// Checks every triangle. Linear time: about a second for a few million triangles. At most 2^31 vertices.
MeshReport checkMesh(std::span<const Vec3f> vertices, std::span<const Triangle> triangles);

/// One sentence per kind of defect, with its consequence for touch; none for a clean mesh.
std::vector<std::string> describe(const MeshReport& report);

}  // namespace hapticd::geometry

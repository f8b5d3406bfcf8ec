// PLY files of any program, by a reader of our own: see docs/decisions/0035-ply-reader.md.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "geometry/types.h"

namespace hapticd::mesh_io {

struct PlyMesh {
  std::vector<geometry::Vec3f> vertices;
  std::vector<std::uint32_t> corners;  ///< of all faces, one after the other
  std::vector<std::uint32_t> sizes;    ///< corners of each face
};

/// Vertices, faces and triangle strips, from text or either byte order. Other elements and properties are
/// skipped, in any order. All corners exist. Throws std::runtime_error with reason and place: a file that
/// ends early is an error.
PlyMesh parsePly(std::string_view bytes);

}  // namespace hapticd::mesh_io

// PLY files of any program, by a reader of our own: see docs/decisions/0035-ply-reader.md.
#pragma once

#include <string_view>

#include "mesh_io/polygons.h"

namespace hapticd::mesh_io {

/// Vertices, faces and triangle strips, from text or either byte order. Other elements and properties are
/// skipped, in any order. All corners exist. Throws std::runtime_error with reason and place: a file that
/// ends early is an error.
PolygonMesh parsePly(std::string_view bytes);

}  // namespace hapticd::mesh_io

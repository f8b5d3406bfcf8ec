// OBJ files of any program, by a reader of our own: see docs/decisions/0052-obj-reader.md.
#pragma once

#include <string_view>

#include "mesh_io/polygons.h"

namespace hapticd::mesh_io {

/// Vertices and faces; all other lines are skipped, and what follows the three coordinates of a vertex
/// (colours, a weight). All corners exist. Throws std::runtime_error with reason and line.
PolygonMesh parseObj(std::string_view bytes);

}  // namespace hapticd::mesh_io

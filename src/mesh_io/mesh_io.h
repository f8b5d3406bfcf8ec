// Meshes from files: OBJ, STL, PLY, glTF, GLB and what else Assimp reads. For the command line; the server
// never opens files for clients.
#pragma once

#include <filesystem>
#include <stdexcept>

#include "geometry/triangle_mesh.h"

namespace hapticd::mesh_io {

/// Names the file and the reason.
class MeshError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// All meshes of a file as one, placed by its nodes, in the file's unit and frame: polygons are cut into
/// triangles, equal vertices joined, points and lines left out. Throws MeshError.
geometry::TriangleMesh loadMesh(const std::filesystem::path& file);

}  // namespace hapticd::mesh_io

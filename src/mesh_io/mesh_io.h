// Meshes from files: OBJ, STL, PLY, glTF, GLB. For the command line; the server never opens files for
// clients.
#pragma once

#include <filesystem>
#include <stdexcept>

#include "geometry/triangle_mesh.h"
#include "mesh_io/confined_process.h"

namespace hapticd::mesh_io {

/// Names the file and the reason.
class MeshError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// All meshes of a file as one, placed by its nodes, in the file's unit and frame: polygons are cut into
/// triangles, equal vertices joined, points and lines left out. All corners exist and all coordinates are
/// finite. The file is untrusted: a child process reads it, without network and within these limits. Throws
/// MeshError.
geometry::TriangleMesh loadMesh(const std::filesystem::path& file, const ConfinedLimits& limits = {});

}  // namespace hapticd::mesh_io

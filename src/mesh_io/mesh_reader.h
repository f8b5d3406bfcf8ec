// Mesh files, read by Assimp in the calling process. Assimp has had memory errors: only mesh_io.h, which
// confines it to a child process, and the fuzzer call this.
#pragma once

#include <filesystem>
#include <string>

#include "geometry/triangle_mesh.h"

namespace hapticd::mesh_io {

/// A mesh with more triangles or vertices is refused.
inline constexpr std::size_t kLargestMesh = 50'000'000;

/// Whether the file's name ends as one of the supported formats does: .obj, .stl, .ply, .gltf, .glb.
bool isSupported(const std::filesystem::path& file);

/// loadMesh() without the child process. Opens no file besides this one and, for glTF, the buffers in the
/// folder of that file. Throws std::runtime_error with the reason alone, std::bad_alloc, or whatever Assimp
/// throws.
geometry::TriangleMesh readMesh(const std::filesystem::path& file);

}  // namespace hapticd::mesh_io

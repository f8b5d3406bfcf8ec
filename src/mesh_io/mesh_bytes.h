// A mesh on its way from the process that read it: counts, vertices, triangles, in this machine's byte order.
#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include "geometry/triangle_mesh.h"

namespace hapticd::mesh_io {

/// Sends all bytes of the mesh, in three parts.
void sendMesh(const geometry::TriangleMesh& mesh,
              const std::function<void(std::span<const std::byte>)>& send);

/// The mesh of untrusted bytes: the counts match, there are triangles, all corners exist, all coordinates are
/// finite. Throws std::runtime_error with the reason.
geometry::TriangleMesh receivedMesh(std::span<const std::byte> bytes);

}  // namespace hapticd::mesh_io

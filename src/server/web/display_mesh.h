// Display meshes: few enough triangles for the page to draw, in the binary format that the page reads.
#pragma once

#include <atomic>
#include <cstddef>
#include <span>

#include "geometry/triangle_mesh.h"
#include "net/send_queue.h"

namespace hapticd::server {

/// Limit for the triangles of all display meshes of a scene together.
inline constexpr std::size_t kDisplayTriangles = 100'000;

/// Triangles that one of `objects` objects may use of kDisplayTriangles. Half is shared evenly, so that a
/// cube beside a scan stays a cube; half is shared by size. The shares of all objects add up to at most
/// kDisplayTriangles.
std::size_t displayShare(std::size_t triangles, std::size_t trianglesInAll, std::size_t objects);

/// Encodes the mesh with at most `most` triangles, simplified if it has more. Triangles with equal, missing
/// or non-finite vertices are dropped. Little endian: "HDM1"; number of vertices, number of triangles and 0
/// as u32; 3 f32 for each vertex; 3 u32 for each triangle. Takes about half a second per million triangles;
/// polls `cancelled` between its three steps and then returns an empty mesh. Any thread.
net::Buffer displayMesh(std::span<const geometry::Vec3f> vertices,
                        std::span<const geometry::Triangle> triangles, std::size_t most,
                        const std::atomic<bool>& cancelled);

/// The number of triangles in a result of displayMesh().
std::size_t displayTriangles(const net::Buffer& mesh);

}  // namespace hapticd::server

// A mesh for the eye: few enough triangles, in the form that the page takes.
#pragma once

#include <atomic>
#include <cstddef>
#include <span>

#include "geometry/triangle_mesh.h"
#include "net/send_queue.h"

namespace hapticd::server {

/// Triangles of all objects of a scene together that the page gets to draw.
inline constexpr std::size_t kDisplayTriangles = 100'000;

/// What one object may have of them: half of all is shared evenly, so that a cube beside a scan stays a cube,
/// the other half by size. The shares of all objects add up to kDisplayTriangles at most.
std::size_t displayShare(std::size_t triangles, std::size_t trianglesInAll, std::size_t objects);

/// With at most `most` triangles: as it is when it has no more, else by clustering of vertices in a grid. In
/// little endian: "HDM1", the numbers of vertices and triangles and 0 as u32; 3 f32 for each vertex; 3 u32
/// for each triangle. Faces without area and with numbers that are none are left out. Takes up to seconds; an
/// empty mesh when `cancelled` meanwhile.
net::Buffer displayMesh(std::span<const geometry::Vec3f> vertices,
                        std::span<const geometry::Triangle> triangles, std::size_t most,
                        const std::atomic<bool>& cancelled);

/// The number of triangles in what displayMesh() gave.
std::size_t displayTriangles(const net::Buffer& mesh);

}  // namespace hapticd::server

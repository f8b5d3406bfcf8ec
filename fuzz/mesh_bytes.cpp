// The mesh that the confined reader of a foreign file sends: it may be in the hands of that file.
#include "mesh_io/mesh_bytes.h"

#include <stdexcept>

#include "fuzz/mesh_check.h"
#include "geometry/mesh_check.h"
#include "geometry/weld.h"

namespace hapticd::fuzz {

void mesh_bytes(Input input) {
  try {
    geometry::TriangleMesh mesh = mesh_io::receivedMesh(input);
    requireSound(mesh);
    static_cast<void>(geometry::describe(geometry::checkMesh(mesh.vertices, mesh.triangles)));
    geometry::weld(mesh);
    requireSound(mesh);
  } catch (const std::runtime_error& error) {
    require(*error.what() != '\0', "a refusal has a reason");
  }
  // Welding is for untrusted meshes, too: the bytes as corners of three vertices.
  geometry::TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 0, 0}}, {}};
  for (std::size_t at = 0; at + 3 <= input.size(); at += 3) {
    const auto corner = [&](std::size_t i) { return static_cast<std::uint32_t>(input[at + i]) % 5; };
    mesh.triangles.push_back({corner(0), corner(1), corner(2)});
  }
  geometry::weld(mesh);
  requireSound(mesh);
}

}  // namespace hapticd::fuzz

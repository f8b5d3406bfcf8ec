#include "bunny.h"

#include <cstdint>
#include <sstream>
#include <string>

// HAPTICD_BUNNY is the path of testdata/meshes/bunny.obj.
asm(".section .rodata\n.balign 16\nhapticd_bunny:\n.incbin \"" HAPTICD_BUNNY
    "\"\nhapticd_bunny_end:\n.previous\n");
extern "C" const char hapticd_bunny[];      // NOLINT(readability-identifier-naming)
extern "C" const char hapticd_bunny_end[];  // NOLINT(readability-identifier-naming)

namespace hapticd::apps {

// Our own file: lines of 'v x y z' and 'f a b c', nothing else.
geometry::TriangleMesh bunny() {
  std::istringstream lines(std::string(hapticd_bunny, hapticd_bunny_end));
  geometry::TriangleMesh mesh;
  for (char kind = 0; lines >> kind;) {
    if (kind == 'v') {
      geometry::Vec3f& v = mesh.vertices.emplace_back();
      lines >> v.x() >> v.y() >> v.z();
    } else {
      geometry::Triangle& t = mesh.triangles.emplace_back();
      for (std::uint32_t& corner : t) {
        lines >> corner;
        --corner;  // numbered from 1 in the file
      }
    }
  }
  return mesh;
}

}  // namespace hapticd::apps

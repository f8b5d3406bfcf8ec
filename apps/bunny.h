// The Stanford bunny, part of the program: something to touch without a file.
#pragma once

#include "geometry/triangle_mesh.h"

namespace hapticd::apps {

/// 1,839 vertices, 3,674 triangles, closed, in the units of its file.
geometry::TriangleMesh bunny();

}  // namespace hapticd::apps

// The size of a mesh on the device.
#pragma once

#include "geometry/triangle_mesh.h"

namespace hapticd::apps {

/// Centres the mesh and scales it to millimetres: its largest extent becomes `size_mm`, or, for 0, the mesh
/// fills 80 % of the smallest common device, at most 100 mm. Throws std::runtime_error without an extent.
void fitIntoWorkspace(geometry::TriangleMesh& mesh, double size_mm = 0);

}  // namespace hapticd::apps

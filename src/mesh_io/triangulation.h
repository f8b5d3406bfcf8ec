// Polygons into triangles, without holes: see docs/decisions/0052-obj-reader.md.
#pragma once

#include "geometry/triangle_mesh.h"
#include "mesh_io/polygons.h"

namespace hapticd::mesh_io {

/// Each face of n corners becomes n - 2 triangles of the same turn, by cutting off ears: they cover a face
/// that does not cross itself once, also one with corners in a row, with notches, or with a hole that a
/// bridge opens. Of a face that is not flat, the view along its normal counts. Quadratic time in the corners
/// of one face.
geometry::TriangleMesh triangulated(PolygonMesh polygons);

}  // namespace hapticd::mesh_io

#include "geometry/triangle_mesh.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/weld.h"

namespace hapticd::geometry {
namespace {

TEST(Box, IsEmptyUntilExtended) {
  Box box;
  EXPECT_TRUE(box.empty());
  box.extend(Vec3(1, 2, 3));
  EXPECT_FALSE(box.empty());
  EXPECT_EQ(box.extents(), Vec3::Zero());
  box.extend(Box{Vec3(-1, 0, 0), Vec3(0, 0, 0)});
  EXPECT_EQ(box.centre(), Vec3(0, 1, 1.5));
  box.extend(Box());
  EXPECT_EQ(box.min, Vec3(-1, 0, 0));
  EXPECT_TRUE((Box{Vec3::Constant(std::nan("")), Vec3::Zero()}).empty());
}

TEST(TriangleMesh, BoundsLeaveOutWhatIsNotFinite) {
  TriangleMesh mesh;
  EXPECT_TRUE(boundsOf(mesh).empty());
  mesh.vertices = {Vec3f(1, 2, 3), Vec3f(NAN, 0, 0), Vec3f(-1, 0, INFINITY), Vec3f(0, 5, 0)};
  EXPECT_EQ(boundsOf(mesh).min, Vec3(0, 2, 0));
  EXPECT_EQ(boundsOf(mesh).max, Vec3(1, 5, 3));
}

TEST(TriangleMesh, ScaleAndMove) {
  TriangleMesh mesh;
  mesh.vertices = {Vec3f(1, 2, 3)};
  scaleAndMove(mesh, 2, Vec3(10, 0, -1));
  EXPECT_EQ(mesh.vertices[0], Vec3f(12, 4, 5));
}

TEST(Weld, SharesVerticesAndDropsUnusedOnes) {
  TriangleMesh mesh;
  mesh.vertices = {Vec3f(9, 9, 9), Vec3f(0, 0, 0), Vec3f(1, 0, 0),    Vec3f(0, 1, 0),
                   Vec3f(1, 0, 0), Vec3f(1, 1, 0), Vec3f(-0.0F, 1, 0)};
  mesh.triangles = {{1, 2, 3}, {4, 5, 6}};
  weld(mesh);
  EXPECT_EQ(mesh.vertices,
            (std::vector<Vec3f>{Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0), Vec3f(1, 1, 0)}));
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {1, 3, 2}}));
}

TEST(Weld, LeavesVerticesThatAreNoNumbersAlone) {
  TriangleMesh mesh;
  mesh.vertices = {Vec3f(0, 0, 0), Vec3f(NAN, 0, 0), Vec3f(NAN, 0, 0)};
  mesh.triangles = {{0, 1, 2}};
  weld(mesh);
  EXPECT_EQ(mesh.vertices.size(), 3U);
  EXPECT_EQ(mesh.triangles[0], (Triangle{0, 1, 2}));
}

TEST(Weld, TrianglesWithoutACornerAreLeftOut) {
  TriangleMesh mesh{{Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)},
                    {{0, 1, 900'000'000}, {0, 1, 2}, {3, 1, 2}}};
  weld(mesh);
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}}));
  EXPECT_EQ(mesh.vertices.size(), 3U);
}

}  // namespace
}  // namespace hapticd::geometry

#include "geometry/mesh_check.h"

#include <gtest/gtest.h>

#include <cmath>

namespace hapticd::geometry {
namespace {

TriangleMesh tetrahedron() {
  return {{Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0), Vec3f(0, 0, 1)},
          {Triangle{0, 2, 1}, Triangle{0, 1, 3}, Triangle{0, 3, 2}, Triangle{1, 2, 3}}};
}

TriangleMesh asTriples(const TriangleMesh& mesh) {
  TriangleMesh soup;
  for (const Triangle& t : mesh.triangles) {
    const auto first = static_cast<std::uint32_t>(soup.vertices.size());
    for (const std::uint32_t i : t) soup.vertices.push_back(mesh.vertices[i]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  return soup;
}

MeshReport check(const TriangleMesh& mesh) {
  return checkMesh(mesh.vertices, mesh.triangles);
}

TEST(MeshCheck, ClosedMeshIsClean) {
  for (const TriangleMesh& mesh : {tetrahedron(), asTriples(tetrahedron())}) {
    const MeshReport report = check(mesh);
    EXPECT_TRUE(report.clean());
    EXPECT_TRUE(report.closed());
    EXPECT_EQ(report.triangles, 4U);
    EXPECT_TRUE(describe(report).empty());
  }
}

TEST(MeshCheck, NothingIsCleanButNotClosed) {
  EXPECT_TRUE(check({}).clean());
  EXPECT_FALSE(check({}).closed());
}

TEST(MeshCheck, MissingTriangleLeavesThreeOpenEdges) {
  TriangleMesh mesh = tetrahedron();
  mesh.triangles.pop_back();
  const MeshReport report = check(mesh);
  EXPECT_EQ(report.openEdges, 3U);
  EXPECT_FALSE(report.closed());
  ASSERT_EQ(describe(report).size(), 1U);
  EXPECT_EQ(describe(report)[0],
            "3 edges have a triangle on one side only: the hand can go around or through there.");
}

TEST(MeshCheck, FlippedTriangleDisagreesWithItsThreeNeighbours) {
  TriangleMesh mesh = tetrahedron();
  std::swap(mesh.triangles[2][0], mesh.triangles[2][1]);
  const MeshReport report = check(mesh);
  EXPECT_EQ(report.flippedEdges, 3U);
  EXPECT_EQ(report.openEdges, 0U);
  EXPECT_FALSE(report.insideOut);
}

TEST(MeshCheck, AllFlippedIsInsideOut) {
  TriangleMesh mesh = tetrahedron();
  for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
  for (Vec3f& v : mesh.vertices) v += Vec3f(100, 200, 300);
  const MeshReport report = check(mesh);
  EXPECT_TRUE(report.insideOut);
  EXPECT_EQ(report.flippedEdges, 0U);
  EXPECT_FALSE(report.clean());
}

TEST(MeshCheck, DuplicatesInAnyOrderAndWinding) {
  TriangleMesh mesh = tetrahedron();
  mesh.triangles.push_back({2, 1, 0});
  mesh.triangles.push_back({0, 1, 2});
  const MeshReport report = check(mesh);
  EXPECT_EQ(report.duplicate, 2U);
  EXPECT_TRUE(report.closed()) << "they are not counted again as edges";
  EXPECT_EQ(report.flippedEdges, 0U);
}

TEST(MeshCheck, TrianglesWithoutArea) {
  TriangleMesh mesh = tetrahedron();
  mesh.vertices.emplace_back(0.5F, 0, 0);
  mesh.vertices.emplace_back(0.5F, 1e-9F, 0);
  mesh.triangles.push_back({0, 0, 1});
  mesh.triangles.push_back({0, 4, 1});
  mesh.triangles.push_back({0, 5, 1});
  EXPECT_EQ(check(mesh).degenerate, 3U);
  EXPECT_TRUE(check(mesh).closed());
  for (Vec3f& v : mesh.vertices) v *= 1e-12F;
  EXPECT_EQ(check(mesh).degenerate, 3U) << "relative to its size";
}

TEST(MeshCheck, CornersThatAreMissingOrNoNumbers) {
  TriangleMesh mesh = tetrahedron();
  mesh.vertices.emplace_back(NAN, 0, 0);
  mesh.triangles.push_back({0, 1, 4});
  mesh.triangles.push_back({0, 1, 99});
  mesh.triangles.push_back({0, 1, 0xFFFFFFFF});
  EXPECT_EQ(check(mesh).incomplete, 3U);
  EXPECT_EQ(check(mesh).openEdges, 0U);
}

TEST(MeshCheck, CoincidentVerticesAreUnweldedUnlessTheMeshIsTriples) {
  TriangleMesh mesh = tetrahedron();
  mesh.vertices.emplace_back(-0.0F, 1, 0);
  mesh.triangles[3] = {1, 4, 3};
  const MeshReport report = check(mesh);
  EXPECT_EQ(report.unwelded, 1U);
  EXPECT_EQ(report.openEdges, 0U);
  EXPECT_EQ(check(asTriples(mesh)).unwelded, 0U);
}

TEST(MeshCheck, FinOnAnEdgeIsCrowded) {
  TriangleMesh mesh = tetrahedron();
  mesh.vertices.emplace_back(0.5F, 0, -1);
  mesh.triangles.push_back({0, 1, 4});
  const MeshReport report = check(mesh);
  EXPECT_EQ(report.crowdedEdges, 1U);
  EXPECT_EQ(report.openEdges, 2U);
}

// A vertex that all triangles share must not make the check slow: groups are sorted, not searched.
TEST(MeshCheck, FanOfManyTriangles) {
  constexpr std::uint32_t kCount = 200'000;
  TriangleMesh mesh;
  mesh.vertices.emplace_back(0, 0, 0);
  for (std::uint32_t i = 0; i <= kCount; ++i) {
    const float angle = 3.0F * static_cast<float>(i) / kCount;
    mesh.vertices.emplace_back(1000 * std::cos(angle), 1000 * std::sin(angle), static_cast<float>(i % 2));
    if (i > 0) mesh.triangles.push_back({0, i, i + 1});
  }
  EXPECT_EQ(check(mesh).openEdges, kCount + 2U);
  EXPECT_EQ(check(mesh).duplicate, 0U);
}

}  // namespace
}  // namespace hapticd::geometry

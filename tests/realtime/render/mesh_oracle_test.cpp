// Tests of the oracle itself: it must detect errors.
#include "mesh_oracle.h"

#include <gtest/gtest.h>

#include <cmath>

#include "meshes.h"

namespace hapticd::realtime::fixture {
namespace {

TEST(MeshOracle, sees_a_way_through_a_face) {
  const MeshOracle oracle(box(Vec3::Constant(-0.01), Vec3::Constant(0.01)));
  EXPECT_EQ(oracle.entered({0.002, 0.001, 0.02}, {0.002, 0.001, 0}), 1);
  EXPECT_EQ(oracle.entered({0.002, 0.001, 0}, {0.002, 0.001, -0.02}), -1);
  EXPECT_EQ(oracle.entered({0.002, 0.001, 0.02}, {0.002, 0.001, -0.02}), 0);  // in and out again
  EXPECT_EQ(oracle.entered({0.003, 0.003, 0.02}, {0.003, 0.003, 0}), 1);      // exactly at a diagonal
  EXPECT_FALSE(oracle.borderNear({0.002, 0.001, 0.02}, {0.002, 0.001, 0}));
}

TEST(MeshOracle, knows_edges_and_borders) {
  const MeshOracle cube(box(Vec3::Constant(-0.01), Vec3::Constant(0.01)));
  EXPECT_NEAR(cube.sharpestEdge({0.0099, 0.001, 0.0101}, {0.0101, 0.001, 0.0099}), M_PI / 2, 1e-9);
  EXPECT_NEAR(cube.sharpestEdge({0.001, 0.003, 0.0101}, {0.002, 0.001, 0.0101}), 0, 1e-9);  // a diagonal
  const MeshOracle sheet(plane(0.01));
  EXPECT_TRUE(sheet.borderNear({0.0099, 0.001, 0.0001}, {0.0101, 0.001, -0.0001}));
}

// The oracle accepts a proxy at rest on a face and rejects one at a wrong place.
TEST(MeshOracle, descends_to_where_the_tool_rests) {
  const double radius = 0.001;
  for (const double r : {0.0, radius}) {
    TriangleMesh corner = box(Vec3::Zero(), Vec3::Constant(0.02));
    for (auto& t : corner.triangles) std::swap(t[1], t[2]);
    const MeshOracle oracle(corner, r);
    const Vec3 hip = Vec3::Constant(r) - Vec3(0.001, 0.0015, 0.002);
    const Vec3 rest = Vec3::Constant(r + 1e-10);
    EXPECT_LT((oracle.descend(rest, hip, 0.05) - rest).norm(), 1e-7);
    EXPECT_LT((oracle.descend(Vec3(0.004, 0.003, 0.005), hip, 0.05) - rest).norm(), 1e-6);
    EXPECT_LT((oracle.descend(Vec3(0.004, r + 1e-10, r + 1e-10), hip, 0.05) - rest).norm(), 1e-6);
  }
}

// The oracle leaves a ridge but does not climb a slope.
TEST(MeshOracle, goes_over_an_edge_but_never_uphill) {
  const MeshOracle oracle(heightField(0.01, 2, [](double x, double) { return 0.002 - 0.2 * std::abs(x); }));
  const Vec3 onRidge(0, 0.001, 0.002 + 1e-10);
  const Vec3 end = oracle.descend(onRidge, {0.004, 0.001, -0.001}, 0.05);
  EXPECT_GT(end.x(), 0.003);
  EXPECT_NEAR(end.z(), 0.002 - 0.2 * end.x(), 1e-6);
  const Vec3 left = oracle.descend({-0.003, 0.001, 0.0014 + 1e-10}, {-0.003, 0.001, -0.001}, 0.05);
  EXPECT_LT(left.x(), 0);
}

}  // namespace
}  // namespace hapticd::realtime::fixture

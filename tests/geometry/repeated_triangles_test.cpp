#include "geometry/repeated_triangles.h"

#include <gtest/gtest.h>

namespace hapticd::geometry {
namespace {

const std::vector<Vec3f> kSquare{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {-0.0F, 0, 0}};

TEST(RepeatedTriangles, NoneInAMeshWithoutRepetition) {
  EXPECT_TRUE(repeatedTriangles(kSquare, std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}).empty());
  EXPECT_TRUE(repeatedTriangles({}, {}).empty());
}

TEST(RepeatedTriangles, MarksAllButTheFirst) {
  const std::vector<Triangle> triangles{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {1, 2, 0}, {2, 0, 1}};
  EXPECT_EQ(repeatedTriangles(kSquare, triangles), (std::vector<bool>{false, false, true, true, true}));
}

TEST(RepeatedTriangles, TheOppositeFrontIsNoRepetition) {
  EXPECT_TRUE(repeatedTriangles(kSquare, std::vector<Triangle>{{0, 1, 2}, {0, 2, 1}}).empty());
}

TEST(RepeatedTriangles, PositionsCountAndNotNumbers) {
  EXPECT_EQ(repeatedTriangles(kSquare, std::vector<Triangle>{{0, 1, 2}, {4, 1, 2}}),
            (std::vector<bool>{false, true}));
}

TEST(RepeatedTriangles, TrianglesThatLackACornerAreNotMarked) {
  EXPECT_TRUE(repeatedTriangles(kSquare, std::vector<Triangle>{{0, 1, 9}, {0, 1, 9}}).empty());
}

}  // namespace
}  // namespace hapticd::geometry

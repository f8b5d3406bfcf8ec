// Messages that make, shape and move objects, checked by a hand that strokes down onto them.
#include <gtest/gtest.h>

#include "feeling.h"
#include "hands.h"

namespace hapticd::test {
namespace {

constexpr float kTurn = 1.5707963F;

class ObjectMessages : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(peer_.untilConnected()); }

  // A stiff stock box in metres, with indexed triangles; 6 and 7 are the top.
  void sendStockBox(std::int32_t object, const Vec3f& half_m = Vec3f::Constant(0.020F)) {
    const std::vector<Vec3f> corners = boxTriples(half_m);
    sendVertices(peer_, object, corners);
    for (std::int32_t t = 0; t < static_cast<std::int32_t>(corners.size()) / 3; ++t) {
      peer_.queue(wire::SetTriangle{object, t, {3 * t, 3 * t + 1, 3 * t + 2}, {-1, -1, -1}});
    }
    peer_.send(kStiff(object));
  }
  static wire::UpdateTrimeshChanges kStiff(std::int32_t object) {
    return {.object = object, .stiffness = 0.5F, .damping = 0, .staticFriction = 0, .dynamicFriction = 0};
  }

  const Hand hand_ = Hand::stroking();
  RunningServer server_{hand_.config()};
  ScriptedPeer peer_{server_.address()};
};

TEST_F(ObjectMessages, SetVertexMakesATriangleOfEveryTriple) {
  sendVertices(peer_, 0, boxTriples(Vec3f::Constant(20)));
  peer_.send(wire::SetHapticProperty{0, "stiffness", 1.0F});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.020));
}

TEST_F(ObjectMessages, SetVertexReplacesByNumber) {
  sendCube(peer_);
  ASSERT_TRUE(untilTouchedAt(peer_, 0, 0.020));
  sendVertices(peer_, 0, boxTriples({20, 26, 20}));
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.026));
}

TEST_F(ObjectMessages, SetTriangleAndUpdateTrimeshChangesMakeAnIndexedMeshInMetres) {
  sendStockBox(0);
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.020));
}

TEST_F(ObjectMessages, UpdateTrimeshChangesSetsTheSurface) {
  sendStockBox(0);
  ASSERT_TRUE(untilTouchedAt(peer_, 0, 0.020));
  wire::UpdateTrimeshChanges soft = kStiff(0);
  soft.stiffness = 0;
  peer_.send(soft);
  ASSERT_TRUE(untilApplied(peer_));
  ASSERT_TRUE(catchUp(peer_));
  EXPECT_TRUE(untilUntouchedStroke(peer_)) << "an object without stiffness gives no force";
}

TEST_F(ObjectMessages, RemoveTriangleOpensTheMesh) {
  sendStockBox(0);
  ASSERT_TRUE(untilTouchedAt(peer_, 0, 0.020));
  peer_.send(wire::RemoveTriangle{0, 6});
  peer_.send(wire::RemoveTriangle{0, 7});
  EXPECT_TRUE(untilUntouchedStroke(peer_));
}

TEST_F(ObjectMessages, SetNormalIsIgnoredWithAText) {
  peer_.send(wire::SetNormal{0, 0, {0, 1, 0}});
  EXPECT_TRUE(peer_.untilText("setNormal object 0: ignored: normals follow from the triangles"));
}

TEST_F(ObjectMessages, SetTrimeshTypeIsIgnoredWithAText) {
  peer_.send(wire::SetTrimeshType{-1, 1});
  EXPECT_TRUE(peer_.untilText("setTrimeshType object -1, type 1: ignored"));
}

TEST_F(ObjectMessages, GetNewObjectIdDoesNothing) {
  sendCube(peer_);
  peer_.send(wire::GetNewObjectId{});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.020));
  EXPECT_TRUE(peer_.open());
}

TEST_F(ObjectMessages, ClearTrimeshRemovesTheMesh) {
  sendCube(peer_);
  ASSERT_TRUE(untilTouchedAt(peer_, 0, 0.020));
  peer_.send(wire::ClearTrimesh{0});
  EXPECT_TRUE(untilUntouchedStroke(peer_));
}

TEST_F(ObjectMessages, TransformTrimeshMovesTheMeshInItsObject) {
  sendStockBox(0);
  peer_.send(wire::TransformTrimesh{0, {1, 0, 0, 0, 0, 1, 0, 0.006F, 0, 0, 1, 0, 0, 0, 0, 1}});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.026));
}

TEST_F(ObjectMessages, SetObjectNumberMakesObjects) {
  peer_.send(wire::SetObjectNumber{3});
  sendCube(peer_, 2);
  EXPECT_TRUE(untilTouchedAt(peer_, 2, 0.020));
}

TEST_F(ObjectMessages, SetTransformMatrixIsColumnMajor) {
  sendCube(peer_);
  peer_.send(wire::SetTransformMatrix{0, {1, 0, 0, 0, 0, 1.25, 0, 0, 0, 0, 1, 0, 0, 3, 0, 1}});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.028));
}

TEST_F(ObjectMessages, SetObjectPositionPlacesInMetres) {
  sendStockBox(0);
  peer_.send(wire::SetObjectPosition{0, {0, 0.005F, 0}});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.025));
}

TEST_F(ObjectMessages, SetObjectOrientationRotates) {
  sendStockBox(0, {0.020F, 0.020F, 0.030F});
  peer_.send(wire::SetObjectOrientation{0, {1, 0, 0}, kTurn});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.030));
}

TEST_F(ObjectMessages, SetObjectScaleScales) {
  sendStockBox(0);
  peer_.send(wire::SetObjectScale{0, {1, 1.5F, 1}});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.030));
}

TEST_F(ObjectMessages, AddObjectMovesWithItsParent) {
  peer_.send(wire::AddObject{5, -1});
  peer_.send(wire::AddObject{6, 5});
  sendStockBox(6);
  ASSERT_TRUE(untilTouchedAt(peer_, 6, 0.020));
  peer_.send(wire::SetObjectPosition{5, {0, 0.005F, 0}});
  EXPECT_TRUE(untilTouchedAt(peer_, 6, 0.025));
}

TEST_F(ObjectMessages, MoveToParentChangesTheParent) {
  peer_.send(wire::AddObject{5, -1});
  peer_.send(wire::SetObjectPosition{5, {0, 0.005F, 0}});
  peer_.send(wire::AddObject{6, -1});
  sendStockBox(6);
  ASSERT_TRUE(untilTouchedAt(peer_, 6, 0.020));
  peer_.send(wire::MoveToParent{6, 5});
  EXPECT_TRUE(untilTouchedAt(peer_, 6, 0.025));
}

TEST_F(ObjectMessages, RemoveObjectRemovesItsChildren) {
  peer_.send(wire::AddObject{5, -1});
  peer_.send(wire::AddObject{6, 5});
  sendStockBox(6);
  ASSERT_TRUE(untilTouchedAt(peer_, 6, 0.020));
  peer_.send(wire::RemoveObject{5});
  EXPECT_TRUE(untilUntouchedStroke(peer_));
  peer_.send(wire::SetTouchableFace{2});
  peer_.send(wire::SetObjectIsTouchable{6, 1});
  EXPECT_TRUE(peer_.untilText("setObjectIsTouchable object 6: refused"));
}

TEST_F(ObjectMessages, SetSceneOriginMovesTheScene) {
  sendCube(peer_);
  peer_.send(wire::SetSceneOrigin{{0, 0.005F, 0}, {0, 0, 1}, 0});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.025));
}

TEST_F(ObjectMessages, AddObjectExSceneStaysWhenTheSceneMoves) {
  peer_.send(wire::AddObjectExScene{4});
  sendStockBox(4);
  peer_.send(wire::SetSceneOrigin{{0, 0.005F, 0}, {0, 0, 1}, 0});
  ASSERT_TRUE(untilApplied(peer_));
  ASSERT_TRUE(catchUp(peer_));
  EXPECT_TRUE(untilTouchedAt(peer_, 4, 0.020));
}

TEST_F(ObjectMessages, SetObjectIsTouchableStartsAndStops) {
  sendCube(peer_);
  ASSERT_TRUE(untilTouchedAt(peer_, 0, 0.020));
  peer_.send(wire::SetObjectIsTouchable{0, 0});
  EXPECT_TRUE(untilUntouchedStroke(peer_));
  peer_.send(wire::SetObjectIsTouchable{0, 1});
  ASSERT_TRUE(catchUp(peer_));
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.020));
}

TEST_F(ObjectMessages, SetTouchableFaceChoosesTheSide) {
  sendCube(peer_);
  ASSERT_TRUE(untilTouchedAt(peer_, 0, 0.020));
  peer_.send(wire::SetTouchableFace{1});
  EXPECT_TRUE(untilUntouchedStroke(peer_)) << "a back face gives no force from outside";
  peer_.send(wire::SetTouchableFace{0});
  ASSERT_TRUE(untilApplied(peer_));
  ASSERT_TRUE(catchUp(peer_));
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.020));
}

TEST_F(ObjectMessages, SetHapticPropertySetsTheStiffness) {
  sendVertices(peer_, 0, boxTriples(Vec3f::Constant(20)));
  ASSERT_TRUE(untilUntouchedStroke(peer_)) << "no force before it has stiffness";
  peer_.send(wire::SetHapticProperty{0, "stiffness", 1.0F});
  EXPECT_TRUE(untilTouchedAt(peer_, 0, 0.020));
}

TEST_F(ObjectMessages, ResetSceneRemovesEverything) {
  peer_.send(wire::SetObjectNumber{2});
  sendCube(peer_, 1);
  peer_.send(wire::SetWorkspaceBoundingBox{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},
                                           {-80, -60, -35, 80, 60, 35}});
  ASSERT_TRUE(untilTouchedAt(peer_, 1, 0.020));
  peer_.send(wire::ResetScene{});
  EXPECT_TRUE(untilUntouchedStroke(peer_));
  peer_.send(wire::SetObjectIsTouchable{1, 1});
  EXPECT_TRUE(peer_.untilText("setObjectIsTouchable object 1: refused"));
}

}  // namespace
}  // namespace hapticd::test

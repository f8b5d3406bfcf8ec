// Well-formed messages with invalid values: each is refused with a text and affects nobody.
#include <cmath>
#include <limits>

#include "bad_input.h"

namespace hapticd::test {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::int32_t kLargest = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t kSmallest = std::numeric_limits<std::int32_t>::min();
constexpr std::array<float, 16> kIdentityRows{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

wire::Effect plainEffect(const char* type, std::int32_t index) {
  return {.type = type,
          .index = index,
          .gain = 0,
          .magnitude = 1,
          .duration = 0,
          .frequency = 0,
          .position = {},
          .direction = {0, 0, 1}};
}

wire::Plane plane(std::int32_t index, float distance, float stiffness) {
  return {.plane = {0, 1, 0, distance},
          .stiffness = stiffness,
          .damping = 0,
          .dynamicFriction = 0,
          .staticFriction = 0,
          .index = index,
          .recoveryCycles = 1};
}

class BadValues : public BadInput {};

TEST_F(BadValues, MissingObjectsAreNamed) {
  for (const std::int32_t id : {-1, 1, 10'000, kLargest, kSmallest}) {
    bad_.forget();
    const auto refused = [&](const char* call) {
      return gotText(std::string(call) + " object " + std::to_string(id) + ": refused");
    };
    bad_.send(wire::SetVertex{id, 0, {1, 2, 3}});
    EXPECT_TRUE(gotText("setObjectVertex object " + std::to_string(id) + ": refused"));
    bad_.send(wire::SetTriangle{id, 0, {0, 1, 2}, {-1, -1, -1}});
    EXPECT_TRUE(refused("setTriangle"));
    bad_.send(wire::SetNormal{id, 0, {}});
    EXPECT_TRUE(refused("setNormal"));
    bad_.send(wire::RemoveTriangle{id, 0});
    EXPECT_TRUE(refused("removeTriangle"));
    bad_.send(wire::ClearTrimesh{id});
    EXPECT_TRUE(refused("clearTrimesh"));
    bad_.send(wire::UpdateTrimeshChanges{id, 0, 0, 0, 0});
    EXPECT_TRUE(refused("updateTrimeshChanges"));
    bad_.send(wire::TransformTrimesh{id, kIdentityRows});
    EXPECT_TRUE(refused("transformTrimesh"));
    bad_.send(wire::MoveToParent{id, -1});
    EXPECT_TRUE(refused("moveToParent"));
    bad_.send(wire::RemoveObject{id});
    EXPECT_TRUE(refused("removeObject"));
    bad_.send(wire::SetObjectPosition{id, {}});
    EXPECT_TRUE(refused("setObjectPosition"));
    bad_.send(wire::SetObjectOrientation{id, {0, 0, 1}, 0});
    EXPECT_TRUE(refused("setObjectOrientation"));
    bad_.send(wire::SetObjectScale{id, {1, 1, 1}});
    EXPECT_TRUE(refused("setObjectScale"));
    bad_.send(wire::SetTransformMatrix{id, kIdentity});
    EXPECT_TRUE(refused("setTransformMatrix"));
    bad_.send(wire::SetHapticProperty{id, "stiffness", 0});
    EXPECT_TRUE(refused("setHapticProperty"));
    bad_.send(wire::SetObjectName{id, "part"});
    EXPECT_TRUE(refused("setObjectName"));
    bad_.send(wire::SetObjectIsTouchable{id, 0});
    EXPECT_TRUE(refused("setObjectIsTouchable"));
  }
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, NumbersWithoutMeaningAreRefusedOrReported) {
  bad_.send(wire::SetObjectNumber{1});
  bad_.send(wire::SetVertex{0, 0, {1e38F, 0, 0}});
  EXPECT_TRUE(gotText("refused: a coordinate is not finite or too large"));
  bad_.send(wire::TrackerSetUpdateRate{1e-300});
  EXPECT_TRUE(gotText("set_update_rate: rate 1e-300 Hz is below the slowest, 0.01 Hz"));
  bad_.send(wire::TrackerSetUpdateRate{1000});
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, InvalidObjectsAreNotAdded) {
  for (const std::int32_t id : {-1, 10'000, kLargest, kSmallest}) {
    bad_.send(wire::AddObject{id, -1});
    EXPECT_TRUE(gotText("addObject object " + std::to_string(id) + ", limit 10000: refused"));
    bad_.send(wire::AddObjectExScene{id});
    EXPECT_TRUE(gotText("addObjectExScene object " + std::to_string(id)));
  }
  bad_.send(wire::AddObject{3, 77});
  EXPECT_TRUE(gotText("addObject object 3, parent 77: refused: there is no such parent"));
  bad_.send(wire::MoveToParent{0, 0});
  EXPECT_TRUE(gotText("moveToParent object 0, parent 0: refused: the object would be its own ancestor"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, VerticesTrianglesPlanesAndEffectsOutOfRangeAreRefused) {
  for (const std::int32_t number : {-1, kSmallest, kLargest}) {
    const std::string text = std::to_string(number);
    bad_.send(wire::SetVertex{0, number, {1, 2, 3}});
    EXPECT_TRUE(gotText("setObjectVertex object 0, vertex " + text));
    bad_.send(wire::SetTriangle{0, number, {0, 1, 2}, {-1, -1, -1}});
    EXPECT_TRUE(gotText("setTriangle object 0, triangle " + text));
    bad_.send(plane(number, -0.02F, 1));
    EXPECT_TRUE(gotText("sendSurface plane " + text));
  }
  bad_.send(wire::SetTriangle{0, 0, {0, -3, 2}, {-1, -1, -1}});
  EXPECT_TRUE(gotText("setTriangle object 0, triangle 0, vertices 0 -3 2: refused"));
  bad_.send(plainEffect("constant", -1));
  EXPECT_TRUE(gotText("setEffect -1"));
  bad_.send(wire::StopEffect{kLargest});
  EXPECT_TRUE(gotText("stopEffect 2147483647: no such effect was defined"));
  EXPECT_TRUE(isIntact());
}

class BadNumbers : public BadInput, public testing::WithParamInterface<float> {};

TEST_P(BadNumbers, OfObjectsAreRefused) {
  const float bad = GetParam();
  bad_.send(wire::SetVertex{0, 4, {0, bad, 0}});
  EXPECT_TRUE(gotText("setObjectVertex object 0, vertex 4 at"));
  bad_.send(wire::SetTransformMatrix{0, {bad, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  EXPECT_TRUE(gotText("setTransformMatrix object 0, row 1, column 1 is "));
  bad_.send(wire::SetHapticProperty{0, "stiffness", bad});
  EXPECT_TRUE(gotText("setHapticProperty object 0, stiffness"));
  bad_.send(wire::UpdateTrimeshChanges{0, bad, 0, 0, 0});
  EXPECT_TRUE(gotText("updateTrimeshChanges object 0"));
  bad_.send(wire::TransformTrimesh{0, {1, 0, 0, bad, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  EXPECT_TRUE(gotText("transformTrimesh object 0, row 1, column 4 is "));
  bad_.send(wire::SetObjectPosition{0, {bad, 0, 0}});
  EXPECT_TRUE(gotText("setObjectPosition object 0"));
  bad_.send(wire::SetObjectOrientation{0, {0, 0, 1}, bad});
  EXPECT_TRUE(gotText("setObjectOrientation object 0"));
  bad_.send(wire::SetObjectScale{0, {1, bad, 1}});
  EXPECT_TRUE(gotText("setObjectScale object 0"));
  EXPECT_TRUE(isIntact());
}

TEST_P(BadNumbers, OfWorldsAndForcesAreRefused) {
  const float bad = GetParam();
  bad_.send(wire::SetWorkspaceBoundingBox{kIdentity, {-80, -60, -35, 80, bad, 35}});
  EXPECT_TRUE(gotText("setWorkspaceBoundingBox from -80 -60 -35 to"));
  bad_.send(wire::SetWorkspaceProjectionMatrix{kIdentity, {bad}});
  EXPECT_TRUE(gotText("setWorkspaceProjectionMatrix projection matrix: row 1, column 1 is "));
  bad_.send(wire::SetHapticOrigin{{bad, 0, 0}, {0, 0, 1}, 0});
  EXPECT_TRUE(gotText("setHapticOrigin"));
  bad_.send(wire::SetHapticScale{bad});
  EXPECT_TRUE(gotText("setHapticScale"));
  bad_.send(wire::SetSceneOrigin{{0, bad, 0}, {0, 0, 1}, 0});
  EXPECT_TRUE(gotText("setSceneOrigin"));
  wire::Effect push = plainEffect("constant", 0);
  push.magnitude = bad;
  bad_.send(push);
  EXPECT_TRUE(gotText("setEffect 0, magnitude: refused"));
  bad_.send(wire::ForceField{{}, {bad, 0, 0}, {}, 1});
  EXPECT_TRUE(gotText("sendForceField"));
  bad_.send(plane(0, bad, 1));
  EXPECT_TRUE(gotText("sendSurface plane 0, 0 1 0"));
  bad_.send(plane(1, -0.02F, bad));
  EXPECT_TRUE(gotText("sendSurface plane 1"));
  bad_.send(wire::Plane2{bad, 0, 0, 0, 0, 0});
  EXPECT_TRUE(gotText("adhesion, texture or buzz"));
  bad_.send(wire::ConstraintPoint{{0, bad, 0}});
  EXPECT_TRUE(gotText("or a direction without length"));
  bad_.send(wire::ConstraintStiffness{bad});
  EXPECT_TRUE(gotText("constraint_KSpring"));
  wire::CustomEffect buzz;
  buzz.parameters.values = {bad};
  bad_.send(buzz);
  EXPECT_TRUE(gotText("startEffect (custom) 0: refused"));
  EXPECT_TRUE(isIntact());
}

INSTANTIATE_TEST_SUITE_P(NotFinite, BadNumbers, testing::Values(kNan, kInfinity, -kInfinity),
                         [](const auto& instance) {
                           return std::string(std::isnan(instance.param) ? "Nan"
                                              : instance.param > 0       ? "Infinity"
                                                                         : "MinusInfinity");
                         });

TEST_F(BadValues, MatricesThatCannotBeInvertedAreRefused) {
  bad_.send(wire::SetTransformMatrix{0, {}});
  EXPECT_TRUE(gotText(
      "setTransformMatrix object 0, last row 0 0 0 0: refused: the matrix is not finite or too large"));
  bad_.send(wire::SetTransformMatrix{0, {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  EXPECT_TRUE(gotText("setTransformMatrix object 0, determinant 0: refused"));
  bad_.send(wire::TransformTrimesh{0, {}});
  EXPECT_TRUE(gotText("transformTrimesh object 0, last row 0 0 0 0: refused"));
  bad_.send(wire::SetObjectScale{0, {1, 0, 1}});
  EXPECT_TRUE(gotText("setObjectScale object 0, scale 1 0 1: refused"));
  bad_.send(wire::SetObjectOrientation{0, {0, 0, 0}, 1});
  EXPECT_TRUE(gotText("setObjectOrientation object 0"));
  bad_.send(wire::SetWorkspaceBoundingBox{{}, {-80, -60, -35, 80, 60, 35}});
  EXPECT_TRUE(
      gotText("setWorkspaceBoundingBox model matrix: last row 0 0 0 0: refused, the old map stays: the model "
              "matrix"));
  bad_.send(wire::SetWorkspaceBoundingBox{kIdentity, {}});
  EXPECT_TRUE(gotText("the view has no extent"));
  bad_.send(wire::SetWorkspaceProjectionMatrix{kIdentity, {}});
  EXPECT_TRUE(gotText("the projection matrix is not finite or singular"));
  bad_.send(wire::SetHapticScale{0});
  EXPECT_TRUE(gotText("setHapticScale 0: refused"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, AMillionObjectsAreRefusedAndTenThousandAreNot) {
  for (const std::int32_t count : {1'000'000, kLargest, -1, kSmallest}) {
    bad_.send(wire::SetObjectNumber{count});
    EXPECT_TRUE(gotText("setObjectNumber " + std::to_string(count) + ", limit 10000: refused"));
  }
  bad_.send(wire::SetObjectNumber{10'000});
  bad_.send(wire::SetObjectIsTouchable{9'999, 1});
  bad_.send(wire::SetObjectIsTouchable{10'000, 1});
  EXPECT_TRUE(gotText("setObjectIsTouchable object 10000: refused"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, VerticesForAMissingObjectAreRefusedAndDoNotAppearLater) {
  const std::vector<Vec3f> higher = boxTriples({20, 30, 20});
  sendVertices(bad_, 3, higher);
  EXPECT_TRUE(gotText("setObjectVertex object 3: refused: there is no such object; call setObjectNumber"));
  bad_.send(wire::SetObjectNumber{4});
  bad_.send(wire::SetHapticProperty{3, "stiffness", 1});
  ASSERT_TRUE(untilApplied(bad_));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, UnknownEffectsAndPropertiesAreNamed) {
  bad_.send(plainEffect("earthquake", 0));
  EXPECT_TRUE(gotText("setEffect 0, 'earthquake': refused: unknown type; use constant, spring"));
  bad_.send(wire::StopEffect{12});
  EXPECT_TRUE(gotText("stopEffect 12: no such effect was defined"));
  bad_.send(wire::SetHapticProperty{0, "squishiness", 1});
  EXPECT_TRUE(gotText("setHapticProperty object 0, 'squishiness': unknown property, ignored; use stiffness"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, AnEffectMayBeStartedJustBeforeItIsDefined) {
  bad_.send(wire::StartEffect{5});
  ASSERT_TRUE(untilApplied(bad_));
  bad_.send(plainEffect("constant", 5));
  EXPECT_TRUE(bad_.until([&] {
    const auto force = bad_.last<wire::Force>();
    return force && force->force[2] > 0.9;
  }));
  bad_.send(wire::StopEffect{5});
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, AnEffectThatIsNeverDefinedIsNamedAfterASecond) {
  bad_.send(wire::StartEffect{6});
  EXPECT_TRUE(gotText("startEffect 6: no such effect was defined within a second; call setEffect first"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadValues, ManyNoticesAreCountedAndDoNotDelayOthers) {
  for (std::int32_t i = 0; i < 20'000; ++i) bad_.queue(wire::SetHapticProperty{100 + i, "stiffness", 1});
  bad_.flush();
  EXPECT_TRUE(gotText("more like this; the last: setHapticProperty object 20099"));
  EXPECT_LE(bad_.count<wire::Text>(), 100U);
  EXPECT_TRUE(isIntact());
}

}  // namespace
}  // namespace hapticd::test

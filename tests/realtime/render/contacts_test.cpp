// The reported contacts: one per touched object, however many of its faces hold the proxy.
#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

class ContactsTest : public VariantTest {
 protected:
  // A wall in the plane x = 0, felt from +x.
  scene::ObjectState& addWall(const scene::Surface& s) {
    TriangleMesh wall;
    wall.vertices = {{0, -0.05F, -0.05F}, {0, 0.05F, -0.05F}, {0, 0.05F, 0.05F}, {0, -0.05F, 0.05F}};
    wall.triangles = {{0, 1, 2}, {0, 2, 3}};
    return add(wall, s);
  }
  static void expectSum(const Rendering& r) {
    Vec3 sum = Vec3::Zero();
    for (std::uint32_t i = 0; i < r.contactCount; ++i) sum += r.contacts[i].force_N;
    EXPECT_NEAR((sum - r.contactForce_N).norm(), 0, 1e-12);
  }
};
INSTANTIATE_TEST_SUITE_P(, ContactsTest, kVariants, variantName);

// A corner of one object has three faces, but is one contact; the floor pushes hardest.
TEST_P(ContactsTest, faces_of_one_object_are_one_contact) {
  TriangleMesh corner = box(Vec3::Zero(), Vec3::Constant(0.05));
  for (auto& t : corner.triangles) std::swap(t[1], t[2]);
  add(corner, surface());
  start({0.004, 0.004, 0.004});
  const Rendering& r = at({-0.001, -0.0015, -0.002});
  ASSERT_EQ(r.contactCount, 1U);
  EXPECT_EQ(r.contacts[0].object, 0);
  EXPECT_NEAR((r.contacts[0].force_N - Vec3(1, 1.5, 2)).norm(), 0, 1e-4);
  EXPECT_NEAR((r.contacts[0].normal - Vec3::UnitZ()).norm(), 0, 1e-9);
  EXPECT_NEAR((r.contacts[0].point_m - offset()).norm(), 0, 1e-7);
  EXPECT_LT(r.contacts[0].triangle, 2U);
  expectSum(r);
}

// Two objects and a plane of the scene: each bears its own part. In their corner they share the mean of their
// stiffnesses.
TEST_P(ContactsTest, each_object_bears_its_own_force) {
  for (const double mu : {0.0, 0.4}) {
    scene = {};
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    addWall(surface(1000, mu, mu));
    add(plane(0.05, 7), surface(500));
    scene::Plane back;
    back.normal = Vec3::UnitY();
    back.offset = -GetParam().worldUnitsPerMetre * GetParam().offset_m;
    back.surface = surface(2000);
    scene.planes = {back};
    start({0.003, 0.003, 0.003});
    at({-0.001, 0.003, -0.002});
    // Friction holds the proxy back from the third face, and so does its larger stiffness.
    const double back_m = mu > 0 ? 0.003 : 0.0005;
    const Rendering& r = at({-0.001, -back_m, -0.002});
    ASSERT_EQ(r.contactCount, 3U);
    expectSum(r);
    for (std::uint32_t i = 0; i < 3; ++i) {
      const Contact& c = r.contacts[i];
      const Vec3 normal = c.object == 0 ? Vec3(1, 0, 0) : (c.object == 1 ? Vec3(0, 0, 1) : Vec3(0, 1, 0));
      const double depth = c.object == 0 ? 0.001 : (c.object == 1 ? 0.002 : back_m);
      EXPECT_NEAR((c.force_N - (1000 + 500 + 2000) / 3.0 * depth * normal).norm(), 0, 1e-4) << c.object;
      EXPECT_NEAR((c.normal - normal).norm(), 0, 1e-9) << c.object;
    }
  }
}

TEST_P(ContactsTest, friction_belongs_to_the_object_that_rubs) {
  addWall(surface(1000, 0.4, 0.4));
  add(plane(0.05, 7), surface());
  start({0.003, 0.003, 0.003});
  at({-0.001, 0.003, -0.001});
  const Rendering& r = to({-0.001, 0.006, -0.001});
  ASSERT_EQ(r.contactCount, 2U);
  expectSum(r);
  EXPECT_LT(r.contactForce_N.y(), -0.1);
  for (std::uint32_t i = 0; i < 2; ++i) {
    EXPECT_EQ(r.contacts[i].force_N.y(), r.contacts[i].object == 0 ? r.contactForce_N.y() : 0.0);
  }
}

// Of the wall, friction included, and not of the floor whose normal force is larger.
TEST_P(ContactsTest, touched_object_exerts_the_largest_force) {
  addWall(surface(1000, 1, 1));
  add(plane(0.05, 7), surface(1000));
  start({0.003, 0.003, 0.003});
  at({-0.002, 0.003, 0.003});
  at({-0.002, 0.001, -0.0021});
  const Rendering& r = at({-0.002, -0.002, -0.0021});
  ASSERT_EQ(r.contactCount, 2U);
  const auto& [first, second] = std::tie(r.contacts[0], r.contacts[1]);
  const Contact& wall = first.normal.x() > 0.9 ? first : second;
  const Contact& floor = first.normal.x() > 0.9 ? second : first;
  ASSERT_GT(floor.force_N.dot(floor.normal), wall.force_N.dot(wall.normal));
  ASSERT_GT(wall.force_N.norm(), floor.force_N.norm());
  EXPECT_EQ(r.touchedObject, wall.object);
}

// A ball between two walls touches each at a place of its own, a radius from its centre.
TEST_P(ContactsTest, the_touched_point_is_on_the_touched_object) {
  constexpr double kRadius_m = 0.001;
  addWall(surface());
  add(plane(0.05, 7), surface());
  start({0.003, 0.003, 0.003}, {.toolRadius_m = kRadius_m});
  EXPECT_EQ(touchedContact(hand->now()), nullptr);
  for (const Vec3& pressed : {Vec3(-0.001, 0.003, -0.002), Vec3(-0.002, 0.003, -0.001)}) {
    at({0.003, 0.003, 0.003});
    const Rendering& r = at(pressed);
    ASSERT_EQ(r.contactCount, 2U);
    const Contact* touched = touchedContact(r);
    ASSERT_NE(touched, nullptr);
    EXPECT_EQ(touched->object, r.touchedObject);
    const bool floor = pressed.z() < pressed.x();
    EXPECT_NEAR((touched->normal - (floor ? Vec3::UnitZ() : Vec3::UnitX())).norm(), 0, 1e-9);
    const Vec3 point = floor ? Vec3(kRadius_m, 0.003, 0) : Vec3(0, 0.003, kRadius_m);
    EXPECT_NEAR((touched->point_m - offset() - point).norm(), 0, 1e-6);
  }
}

// An adhesive plane is a contact that pulls.
TEST_P(ContactsTest, adhesion_is_a_contact) {
  scene::Plane floor;
  floor.normal = Vec3::UnitZ();
  floor.offset = -GetParam().worldUnitsPerMetre * GetParam().offset_m;
  floor.surface = surface();
  floor.adhesionNormal_N = 0.5;
  scene.planes = {floor};
  start({0, 0, 0.0003});
  to({0, 0, -0.001});
  const Rendering& r = to({0, 0, 0.0004});
  ASSERT_EQ(r.contactCount, 1U);
  EXPECT_EQ(r.contacts[0].object, -1);
  EXPECT_NEAR((r.contacts[0].force_N - Vec3(0, 0, -0.4)).norm(), 0, 1e-4);
  EXPECT_NEAR((r.contacts[0].point_m - offset()).norm(), 0, 1e-6) << "on the plane, 0.4 mm below the hand";
  EXPECT_NEAR((r.contacts[0].normal - Vec3::UnitZ()).norm(), 0, 1e-9);
  expectSum(r);
  EXPECT_EQ(to({0, 0, 0.001}).contactCount, 0U);
}

}  // namespace
}  // namespace hapticd::realtime::fixture

// Objects that appear around a HIP never grip it: they are felt once the HIP has left them.
#include <cmath>
#include <random>

#include "loop.h"

namespace hapticd::realtime::commands {
namespace {

const std::vector<Vec3> kWays{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};

class Appearing : public testing::TestWithParam<double> {
 protected:
  Appearing() : loop({.toolRadius_m = GetParam()}) {}

  void addCube(std::int32_t id = 0) { loop.add(id, boxTriples(Vec3::Constant(-10), Vec3::Constant(10))); }

  // The hand leaves through a side without a force, and feels that side when it returns.
  void expectFeltOnlyFromOutside(const Vec3& inside_m, const Vec3& way) {
    double most = 0;
    bool reported = true;
    const Vec3 outside = inside_m + (0.011 + GetParam() - way.dot(inside_m)) * way;
    loop.to(outside, [&] {
      most = std::max(most, loop.out.force_N.norm());
      const double height = way.dot(loop.state.position_m) - 0.010;
      if (height < -1e-4) reported = reported && (loop.out.status & ~kRenderGeometryJump) != 0;
    });
    EXPECT_EQ(most, 0) << way.transpose();
    EXPECT_TRUE(reported) << way.transpose();
    loop.tick(outside + 0.001 * way);
    EXPECT_EQ(loop.out.status, 0U) << way.transpose();
    loop.to(outside - 0.003 * way);
    EXPECT_NEAR(loop.out.force_N.dot(way), 0.002 * kStiffness_N_per_m, 0.01) << way.transpose();
    loop.to(outside + 0.005 * way);
  }

  Loop loop;
};
INSTANTIATE_TEST_SUITE_P(, Appearing, testing::Values(0.0, 0.002),
                         [](const auto& test) { return test.param > 0 ? "ball" : "point"; });

TEST_P(Appearing, object_loaded_around_the_hand) {
  for (const Vec3& way : kWays) {
    loop.send(scene::ResetScene{});
    const Vec3 inside = 0.003 * way + Vec3(0.0011, 0.0007, 0.0013);
    loop.rest(inside, toNanos(0.1));
    loop.send(scene::SetObjectNumber{1});
    addCube();
    loop.rest(inside, toNanos(0.1));
    expectFeltOnlyFromOutside(inside, way);
  }
}

TEST_P(Appearing, object_made_touchable_around_the_hand) {
  addCube();
  for (const Vec3& way : kWays) {
    loop.send(scene::SetTouchable{0, false});
    const Vec3 inside = 0.007 * way + Vec3(0.0011, 0.0007, 0.0013);
    loop.rest(inside, toNanos(0.1));
    loop.send(scene::SetTouchable{0, true});
    loop.rest(inside, toNanos(0.1));
    expectFeltOnlyFromOutside(inside, way);
  }
}

TEST_P(Appearing, object_that_gets_stiffness_around_the_hand) {
  addCube();
  loop.send(scene::SetSurfaceProperty{0, "stiffness", 0});
  const Vec3 inside(0.0011, 0.0007, 0.0013);
  loop.rest(inside, toNanos(0.1));
  loop.send(scene::SetSurfaceProperty{0, "stiffness", 1});
  loop.rest(inside, toNanos(0.1));
  expectFeltOnlyFromOutside(inside, {0, 1, 0});
}

TEST_P(Appearing, first_tick_inside_an_object) {
  addCube();
  loop.now += toNanos(0.1);
  loop.publish();
  expectFeltOnlyFromOutside({0.0011, 0.0007, 0.0013}, {0, 1, 0});
}

// A workspace that puts the hand into the object.
TEST_P(Appearing, workspace_that_changes_around_the_hand) {
  addCube();
  loop.place(0, {0, 100, 0});
  const Vec3 inside(0.0011, 0.0007, 0.0013);
  loop.rest(inside, toNanos(0.5));
  loop.send(scene::SetHapticOrigin{Vec3(0, 0.1, 0), Vec3::UnitX(), 0});
  loop.rest(inside, toNanos(0.1));
  expectFeltOnlyFromOutside(inside, {0, 1, 0});
}

TEST_P(Appearing, both_faces_of_a_mesh_around_the_hand) {
  loop.send(scene::SetTouchableFaces{0});
  addCube();
  const Vec3 inside(0.0011, 0.0007, 0.0013);
  loop.send(scene::SetTouchable{0, false});
  loop.rest(inside, toNanos(0.1));
  loop.send(scene::SetTouchable{0, true});
  loop.rest(inside, toNanos(0.1));
  loop.send(scene::SetTouchableFaces{2});
  loop.rest(inside, toNanos(0.1));
  expectFeltOnlyFromOutside(inside, {0, 1, 0});
}

// Within two overlapping parts of one mesh, and within a mesh that is wound the wrong way.
TEST_P(Appearing, parts_that_overlap_and_inverted_meshes) {
  std::vector<Vec3f> two = boxTriples(Vec3::Constant(-10), Vec3::Constant(10));
  const std::vector<Vec3f> second = boxTriples(Vec3::Constant(-5), Vec3(9, 9, 9));
  two.insert(two.end(), second.begin(), second.end());
  std::vector<Vec3f> inverted = boxTriples(Vec3::Constant(-10), Vec3::Constant(10));
  for (std::size_t i = 0; i < inverted.size(); i += 3) std::swap(inverted[i], inverted[i + 1]);
  for (const auto& mesh : {two, inverted}) {
    loop.send(scene::ResetScene{});
    const Vec3 inside(0.0011, 0.0007, 0.0013);
    loop.rest(inside, toNanos(0.1));
    loop.send(scene::SetObjectNumber{1});
    loop.add(0, mesh);
    loop.rest(inside, toNanos(0.1));
    expectFeltOnlyFromOutside(inside, {0, 1, 0});
  }
}

// The object leaves the hand instead of the hand the object.
TEST_P(Appearing, object_that_moves_away_from_the_hand_does_not_take_it_along) {
  const Vec3 inside(0.0011, 0.0047, 0.0013);
  loop.rest(inside, toNanos(0.1));
  addCube();
  loop.rest(inside, toNanos(0.3));
  EXPECT_NE(loop.out.status, 0U);
  loop.place(0, {0, -12, 0});
  loop.rest(inside, toNanos(0.3), [&] { EXPECT_EQ(loop.out.force_N.norm(), 0); });
  EXPECT_EQ(loop.out.status, 0U);
  loop.place(0, {0, -3 - 1e3 * GetParam(), 0});
  loop.rest(inside, toNanos(0.1));
  EXPECT_NEAR(loop.out.force_N.y(), 0.0023 * kStiffness_N_per_m, 0.01);
}

// A room whose walls face inwards, touchable from the front: the hand is not behind its walls. A mirrored
// placement turns the winding over and not the walls.
TEST_P(Appearing, room_around_the_hand_is_felt_at_once) {
  std::vector<Vec3f> room = boxTriples(Vec3::Constant(-10), Vec3::Constant(10));
  for (std::size_t i = 0; i < room.size(); i += 3) std::swap(room[i], room[i + 1]);
  const Vec3 inside(0.0011, 0.0007, 0.0013);
  for (const double side : {1.0, -1.0}) {
    loop.send(scene::ResetScene{});
    loop.send(scene::SetTouchableFaces{0});
    loop.rest(inside, toNanos(0.1));
    loop.send(scene::SetObjectNumber{1});
    loop.send(scene::SetTransform{0, {side, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
    loop.add(0, room);
    loop.rest(inside, toNanos(0.1));
    EXPECT_EQ(loop.out.status, 0U) << side;
    loop.to({0.001, -0.012 + GetParam(), 0.002});
    EXPECT_NEAR(loop.out.force_N.y(), 1, 0.01) << side;
    loop.to(inside);
  }
}

TEST_P(Appearing, mirrored_object_whose_fronts_are_touchable) {
  for (const Vec3& way : kWays) {
    loop.send(scene::ResetScene{});
    loop.send(scene::SetTouchableFaces{0});
    const Vec3 inside = 0.003 * way + Vec3(0.0011, 0.0007, 0.0013);
    loop.rest(inside, toNanos(0.1));
    loop.send(scene::SetObjectNumber{1});
    loop.send(scene::SetTransform{0, {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
    addCube();
    loop.rest(inside, toNanos(0.1));
    expectFeltOnlyFromOutside(inside, way);
  }
}

// Its vertices travel until it has left the hand.
TEST_P(Appearing, object_that_deforms_away_from_the_hand) {
  const Vec3 inside(0.0011, 0.0007, 0.0013);
  loop.rest(inside, toNanos(0.1));
  addCube();
  loop.rest(inside, toNanos(0.1));
  for (int by_mm = 1; by_mm <= 40; ++by_mm) {
    std::vector<Vec3f> vertices = boxTriples(Vec3::Constant(-10), Vec3::Constant(10));
    for (Vec3f& v : vertices) v.x() += static_cast<float>(by_mm);
    loop.send(scene::SetVertices{0, 0, vertices});
    loop.rest(inside, 16 * kMs, [&] { EXPECT_EQ(loop.out.force_N.norm(), 0) << by_mm << " mm"; });
  }
  EXPECT_EQ(loop.out.status, 0U);
}

// Others are felt meanwhile: a floor inside the cube that appears.
TEST_P(Appearing, other_objects_stay_felt) {
  loop.add(0, boxTriples(Vec3(-5, -5, -5), Vec3(5, 0, 5)));
  const Vec3 above(0.001, GetParam() + 0.001, 0.002);
  loop.rest(above, toNanos(0.1));
  loop.to(above - Vec3(0, 0.003, 0));
  EXPECT_NEAR(loop.out.force_N.y(), 1, 0.01);
  addCube(1);
  loop.rest(above - Vec3(0, 0.003, 0), toNanos(0.1));
  EXPECT_NEAR(loop.out.force_N.y(), 1, 0.01);
  EXPECT_EQ(loop.out.touchedObject, 0);
}

// An open surface is not around the hand: a sheet approached from its back, and a cup from within.
TEST_P(Appearing, open_surfaces_are_felt_at_once) {
  loop.rest({0.001, -0.005, 0.002}, toNanos(0.1));
  loop.add(0, sheetTriples(40));
  loop.rest({0.001, -0.005, 0.002}, toNanos(0.1));
  EXPECT_EQ(loop.out.status, 0U);
  loop.to({0.001, 0.002 - GetParam(), 0.002});
  EXPECT_NEAR(loop.out.force_N.y(), -1, 0.01) << "from the back";

  loop.send(scene::ResetScene{});
  const Vec3 inside(0.001, 0.001, 0.002);
  loop.rest(inside, toNanos(0.1));
  std::vector<Vec3f> cup = boxTriples(Vec3::Constant(-10), Vec3::Constant(10));
  cup.erase(cup.begin() + 18, cup.begin() + 24);  // without its top
  loop.send(scene::SetObjectNumber{1});
  loop.add(0, cup);
  loop.rest(inside, toNanos(0.1));
  EXPECT_EQ(loop.out.status, 0U);
  loop.to({0.001, -0.012 + GetParam(), 0.002});
  EXPECT_NEAR(loop.out.force_N.y(), 1, 0.01) << "on the bottom of the cup";
}

// A pocket is open on one side only, which is 7 % of what the hand in it sees.
TEST_P(Appearing, pockets_in_any_position_are_felt_at_once) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 200; ++k) {
    const geometry::Mat3 turn = geometry::Quat(normal(random), normal(random), normal(random), normal(random))
                                    .normalized()
                                    .toRotationMatrix();
    std::vector<Vec3f> pocket = boxTriples(Vec3(-10, -18, -10), Vec3(10, 18, 10));
    pocket.erase(pocket.begin() + 18, pocket.begin() + 24);  // without its top
    for (Vec3f& v : pocket) v = (turn * v.cast<double>()).cast<float>();
    loop.send(scene::ResetScene{});
    loop.send(scene::SetObjectNumber{1});
    const Vec3 inside(0.0001, 0.0007, 0.0003);
    loop.rest(inside, toNanos(0.1));
    loop.add(0, pocket);
    loop.rest(inside, toNanos(0.1));
    EXPECT_EQ(loop.out.status, 0U) << k;
    loop.to(turn * Vec3(0.001, -0.020 + GetParam(), 0.002));
    EXPECT_NEAR((turn.transpose() * loop.out.force_N).y(), 1, 0.01) << k;
    loop.to(inside);
  }
}

// New triangles of a touched mesh: the proxy is outside, although the HIP is inside.
TEST_P(Appearing, touched_mesh_with_new_triangles_stays_felt) {
  addCube();
  const Vec3 above(0.001, 0.011 + GetParam(), 0.002);
  loop.rest(above, toNanos(0.1));
  loop.to(above - Vec3(0, 0.003, 0));
  EXPECT_NEAR(loop.out.force_N.y(), 1, 0.01);
  for (const double top : {10.0, 10.1, 9.9}) {
    std::vector<Vec3f> mesh = boxTriples(Vec3::Constant(-10), Vec3(10, top, 10));
    const std::vector<Vec3f> more = boxTriples(Vec3(-10, -14, -10), Vec3(10, -12, 10));
    mesh.insert(mesh.end(), more.begin(), more.end());
    if (top == 9.9) mesh.resize(mesh.size() - 3);
    loop.send(scene::ClearMesh{0});
    loop.send(scene::SetVertices{0, 0, mesh});
    loop.rest(above - Vec3(0, 0.003, 0), toNanos(0.3));
    EXPECT_NEAR(loop.out.force_N.y(), kStiffness_N_per_m * (1e-3 * top - 0.008), 0.01) << top;
  }
}

// A corner of a floor and a wall; each in turn gets new triangles that reach farther into the hand, and each
// in turn is pressed harder.
class NewTriangles : public Appearing {
 protected:
  static constexpr double kHarder_mm = 2;
  static constexpr double kSofter_mm = 1.4;

  std::vector<Vec3f> floorTriples(double rise_mm) const {
    return boxTriples(Vec3(-30, -30, -30), Vec3(30, rise_mm, 30));
  }
  std::vector<Vec3f> wallTriples(double rise_mm) const {
    return boxTriples(Vec3(-rise_mm, -20, -30), Vec3(30, 30, 30));
  }
  void upload(std::int32_t id, std::vector<Vec3f> triples) {
    loop.send(scene::ClearMesh{id});
    loop.send(scene::SetVertices{id, 0, std::move(triples)});
  }
};
INSTANTIATE_TEST_SUITE_P(, NewTriangles, testing::Values(0.0, 0.002),
                         [](const auto& test) { return test.param > 0 ? "ball" : "point"; });

TEST_P(NewTriangles, of_any_touched_mesh_are_felt_at_once) {
  const double radius_mm = 1e3 * GetParam();
  for (const bool wallIsNew : {true, false}) {
    for (const bool wallIsHarder : {true, false}) {
      for (const double step_mm : {0.0, 0.001, 0.02, 0.2, 0.45, 1.2}) {
        loop.send(scene::ResetScene{});
        loop.send(scene::SetObjectNumber{2});
        loop.send(scene::SetTouchableFaces{0});
        loop.add(0, floorTriples(0));
        loop.add(1, wallTriples(0));
        const double depth_mm = wallIsHarder ? kSofter_mm : kHarder_mm;  // of the hand below the floor
        const double into_mm = wallIsHarder ? kHarder_mm : kSofter_mm;   // and behind the wall
        const Vec3 pressed = 1e-3 * Vec3(into_mm - radius_mm, radius_mm - depth_mm, 2);
        loop.rest(pressed + Vec3(-0.010, 0.010, 0), toNanos(0.5));
        loop.to(pressed);
        loop.rest(pressed, toNanos(0.1));
        for (int k = 1; k <= 3; ++k) {
          const double rise_mm = k * step_mm;
          upload(wallIsNew ? 1 : 0, wallIsNew ? wallTriples(rise_mm) : floorTriples(rise_mm));
          loop.rest(pressed, toNanos(0.1));
          const Vec3 depths(-into_mm - (wallIsNew ? rise_mm : 0), depth_mm + (wallIsNew ? 0 : rise_mm), 0);
          EXPECT_NEAR((loop.out.force_N - 1e-3 * kStiffness_N_per_m * depths).norm(), 0, 1e-3)
              << (wallIsNew ? "wall " : "floor ") << k << " x " << step_mm
              << " mm: " << loop.out.force_N.transpose();
          EXPECT_EQ(loop.out.status, 0U);
        }
      }
    }
  }
}

// A horizontal one, from -30 to 30 mm, with its front above.
std::vector<Vec3f> sheet(double y_mm) {
  const auto corner = [&](float x, float z) { return Vec3f(x, static_cast<float>(y_mm), z); };
  return {corner(-30, -30), corner(-30, 30), corner(30, 30),
          corner(-30, -30), corner(30, 30),  corner(30, -30)};
}

// Sheets: around nothing, so only what held the tool tells which side it was on.
TEST_P(NewTriangles, of_open_surfaces_rise_and_sink_under_the_hand) {
  const double radius_mm = 1e3 * GetParam();
  for (const std::int32_t sides : {0, 2}) {  // front, both
    for (const double step_mm : {0.0, 0.001, 0.01, 0.2, 0.45, 1.2, -0.2}) {
      loop.send(scene::ResetScene{});
      loop.send(scene::SetObjectNumber{1});
      loop.send(scene::SetTouchableFaces{sides});
      const Vec3 pressed = 1e-3 * Vec3(1, radius_mm - 1.7, 2);
      loop.rest(pressed + Vec3(0, 0.010, 0), toNanos(0.5));
      loop.add(0, sheet(0));
      loop.to(pressed);
      for (int k = 0; k <= 3; ++k) {
        upload(0, sheet(k * step_mm));
        loop.rest(pressed, toNanos(0.1));
        EXPECT_NEAR((loop.out.force_N - 1e-3 * kStiffness_N_per_m * Vec3(0, 1.7 + k * step_mm, 0)).norm(), 0,
                    1e-3)
            << "sides " << sides << ", " << k << " x " << step_mm << " mm: " << loop.out.force_N.transpose();
        EXPECT_EQ(loop.out.status, 0U);
      }
    }
  }
}

// A plate above the floor, of the same mesh: the hand stays between them.
TEST_P(NewTriangles, lift_the_hand_through_no_layer_above) {
  if (GetParam() > 0) return;  // a ball does not fit between
  const auto layers = [this](double rise_mm) {
    std::vector<Vec3f> mesh = floorTriples(rise_mm);
    const std::vector<Vec3f> plate = boxTriples(Vec3(-20, rise_mm + 0.2, -20), Vec3(20, rise_mm + 0.4, 20));
    mesh.insert(mesh.end(), plate.begin(), plate.end());
    return mesh;
  };
  for (const double rise_mm : {0.1, 0.15, 0.6, 1.1}) {
    loop.send(scene::ResetScene{});
    loop.send(scene::SetObjectNumber{1});
    loop.send(scene::SetTouchableFaces{0});
    loop.add(0, layers(0));
    loop.rest(1e-3 * Vec3(25, 5, 2), toNanos(0.5));
    loop.to(1e-3 * Vec3(25, 0.1, 2));
    loop.to(1e-3 * Vec3(1, 0.1, 2));
    loop.to(1e-3 * Vec3(1, -1, 2));
    upload(0, layers(rise_mm));
    loop.rest(1e-3 * Vec3(1, -1, 2), toNanos(0.1));
    EXPECT_NEAR(1e3 * loop.out.proxy_m.y(), rise_mm, 1e-3);
  }
}

// Two objects in turn, as of a program that prepares the next mesh while the last one is felt.
TEST_P(NewTriangles, of_an_object_that_replaces_another_are_felt_at_once) {
  const double radius_mm = 1e3 * GetParam();
  const auto open = [](double y_mm) { return sheet(y_mm); };
  const auto closed = [this](double y_mm) { return floorTriples(y_mm); };
  for (const std::function<std::vector<Vec3f>(double)>& floor :
       std::initializer_list<std::function<std::vector<Vec3f>(double)>>{open, closed}) {
    for (const double step_mm : {0.0, 0.2, 1.2, -0.2}) {
      loop.send(scene::ResetScene{});
      loop.send(scene::SetObjectNumber{2});
      loop.send(scene::SetTouchableFaces{0});
      const Vec3 pressed = 1e-3 * Vec3(1, radius_mm - 1.7, 2);
      loop.rest(pressed + Vec3(0, 0.010, 0), toNanos(0.5));
      loop.add(0, floor(0));
      loop.send(scene::SetSurfaceProperty{1, "stiffness", 1});
      loop.to(pressed);
      for (int k = 1; k <= 3; ++k) {
        loop.send(scene::BeginBatch{});
        loop.send(scene::SetTouchable{(k + 1) % 2, false});
        upload(k % 2, floor(k * step_mm));
        loop.send(scene::SetTouchable{k % 2, true});
        loop.send(scene::CommitBatch{});
        loop.rest(pressed, toNanos(0.1));
        EXPECT_NEAR(loop.out.force_N.y(), 1e-3 * kStiffness_N_per_m * (1.7 + k * step_mm), 1e-3)
            << k << " x " << step_mm << " mm";
        EXPECT_EQ(loop.out.status, 0U);
      }
    }
  }
}

// The lower sheet still holds the point, so the upper one is no surface that rose.
TEST_P(NewTriangles, of_open_surfaces_do_not_lift_the_hand_out_of_a_slit) {
  if (GetParam() > 0) return;  // a ball does not fit into it
  std::vector<Vec3f> slit = sheet(0);
  const std::vector<Vec3f> above = sheet(0.3);
  slit.insert(slit.end(), above.begin(), above.end());
  loop.send(scene::SetTouchableFaces{0});
  loop.rest(Vec3(0.040, 0.00015, 0.002), toNanos(0.5));
  loop.add(0, slit);
  loop.to(Vec3(0.001, 0.00015, 0.002));
  const Vec3 pressed(0.001, -0.0017, 0.002);
  loop.to(pressed);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(loop.out.force_N.y(), 1.7e-3 * kStiffness_N_per_m, 1e-3) << k;
    upload(0, slit);
    loop.rest(pressed, toNanos(0.1));
  }
}

// A floor of two objects; the hand rests on one and the other gets new triangles.
TEST_P(NewTriangles, beside_the_touched_mesh_hold_the_hand_that_comes) {
  const double radius_mm = 1e3 * GetParam();
  for (const double rise_mm : {0.0, 0.001, 0.2}) {
    loop.send(scene::ResetScene{});
    loop.send(scene::SetObjectNumber{2});
    loop.send(scene::SetTouchableFaces{0});
    loop.add(0, boxTriples(Vec3(-30, -30, -30), Vec3(0, 0, 30)));
    loop.add(1, boxTriples(Vec3(0, -30, -30), Vec3(30, 0, 30)));
    const Vec3 pressed = 1e-3 * Vec3(-0.5, radius_mm - 1, 2);
    loop.rest(pressed + Vec3(0, 0.010, 0), toNanos(0.5));
    loop.to(pressed);
    upload(1, boxTriples(Vec3(0, -30, -30), Vec3(30, rise_mm, 30)));
    loop.rest(pressed, toNanos(0.1));
    loop.to(pressed + Vec3(0.010, 0, 0));
    const double depth_mm = 1 + rise_mm;
    // A point stops at a step; the ball rolls over it.
    if (GetParam() == 0 && rise_mm > 0.1) continue;
    EXPECT_NEAR(loop.out.force_N.y(), 1e-3 * depth_mm * kStiffness_N_per_m, 2e-3) << rise_mm;
    EXPECT_EQ(loop.out.status, 0U) << rise_mm;
  }
}

// While friction of the floor holds the proxy, the wall that comes nearer takes it along by just that way.
TEST_P(NewTriangles, leave_friction_of_others_as_it_is) {
  const double radius_mm = 1e3 * GetParam();
  loop.send(scene::SetTouchableFaces{0});
  loop.add(0, floorTriples(0));
  loop.add(1, wallTriples(0));
  loop.send(scene::SetSurfaceProperty{0, "static friction", 1});
  loop.send(scene::SetSurfaceProperty{0, "dynamic friction", 1});
  const Vec3 pressed = 1e-3 * Vec3(0.3 - radius_mm, radius_mm - 3, 2);
  loop.rest(pressed + Vec3(-0.001, 0.010, 0), toNanos(0.5));
  loop.to(pressed + Vec3(-0.001, 0, 0));
  loop.to(pressed);
  loop.rest(pressed, toNanos(0.1));
  upload(1, wallTriples(0.1));
  loop.rest(pressed, toNanos(0.1));
  EXPECT_LE(1e3 * (loop.out.proxy_m.x() - pressed.x()), -0.3);
  EXPECT_GE(1e3 * (loop.out.proxy_m.x() - pressed.x()), -1.01);
  EXPECT_NEAR(loop.out.force_N.y(), 3e-3 * kStiffness_N_per_m, 1e-2);
}

// What exerts no force makes nothing else stiffer either.
TEST_P(Appearing, object_around_the_hand_leaves_what_it_touches_as_it_is) {
  loop.add(0, boxTriples(Vec3(-40, -30, -40), Vec3(40, 0, 40)));
  const Vec3 pressed(0.001, GetParam() - 0.003, 0.002);
  loop.rest({0.001, 0.010, 0.002}, toNanos(0.1));
  loop.to(pressed);
  ASSERT_NEAR(loop.out.force_N.y(), 1.5, 0.01);
  loop.send(scene::SetObjectNumber{2});
  loop.add(1, boxTriples(Vec3(-20, -20, -20), Vec3(20, 8, 20)));
  for (const double stiffness : {4.0, 1.0, 4.0, 0.2}) {
    loop.send(scene::SetSurfaceProperty{1, "stiffness", stiffness});
    loop.rest(pressed, toNanos(0.02), [&] { EXPECT_NEAR(loop.out.force_N.y(), 1.5, 0.01) << stiffness; });
    EXPECT_NE(loop.out.status & kRenderEnclosed, 0U);
  }
}

// The touched face is on the other side then, and the hand inside.
TEST_P(Appearing, object_that_is_mirrored_or_turned_over_under_the_hand) {
  const std::array<double, 16> mirrored{1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const std::array<double, 16> turned{1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1};
  for (const auto& pose : {mirrored, turned}) {
    loop.send(scene::ResetScene{});
    loop.rest({0.003, 0.014, 0.002}, toNanos(0.3));
    loop.add(0, boxTriples(Vec3(-20, -8, -20), Vec3(20, 8, 20)));
    // A new parent: a placement that is not interpolated.
    loop.send(scene::SetObjectNumber{2});
    loop.send(scene::SetTransform{1, pose});
    loop.rest({0.003, 0.014, 0.002}, toNanos(0.1));
    const Vec3 pressed(0.003, 0.006 + GetParam(), 0.002);
    loop.to(pressed);
    ASSERT_NEAR(loop.out.force_N.y(), 1, 0.01);
    loop.send(scene::MoveToParent{0, 1});
    loop.tick(pressed);
    EXPECT_NE(loop.out.status & kRenderGeometryJump, 0U);
    loop.rest(pressed, toNanos(0.1), [&] { EXPECT_EQ(loop.out.force_N.norm(), 0); });
    EXPECT_NE(loop.out.status & kRenderEnclosed, 0U);
  }
}

}  // namespace
}  // namespace hapticd::realtime::commands

// A tool with a radius: it stays that far off faces, edges and corners, and rounds them.
#include <utility>

#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

constexpr RenderOptions kBall{.toolRadius_m = 0.001};

class BallTest : public VariantTest {};
INSTANTIATE_TEST_SUITE_P(, BallTest, kVariants, variantName);

TEST_P(BallTest, plane_is_felt_a_radius_early) {
  add(heightField(
          0.01, 40, [](double, double) { return 0.0; }, 0.3),
      surface());
  start({0.0013, 0.0021, 0.002}, kBall);
  EXPECT_EQ(to({0.0013, 0.0021, 0.00101}).force_N.norm(), 0);
  for (int i = 1; i < 40; ++i) {
    const Rendering& r = to({0.0013 + i * 5e-5, 0.0021, 0.001 - i * 5e-5});
    EXPECT_NEAR((r.force_N - Vec3(0, 0, i * 0.05)).norm(), 0, 1e-4);
    EXPECT_NEAR((r.scp_m - offset()).z(), 0, 1e-7);
    EXPECT_EQ(r.status, 0U);
  }
}

TEST_P(BallTest, concave_edge_holds_it_off_both_walls) {
  TriangleMesh corner = box(Vec3::Zero(), Vec3::Constant(0.05));
  for (auto& t : corner.triangles) std::swap(t[1], t[2]);
  add(corner, surface());
  start({0.004, 0.02, 0.004}, kBall);
  EXPECT_NEAR((at({0, 0.02, -0.001}).force_N - Vec3(1, 0, 2)).norm(), 0, 1e-4);
  EXPECT_NEAR((proxy() - Vec3(0.001, 0.02, 0.001)).norm(), 0, 1e-6);
}

// A corner seen from outside is a small sphere.
TEST_P(BallTest, convex_corner_is_rounded) {
  add(box(Vec3::Constant(-0.02), Vec3::Zero()), surface());
  for (const Vec3& from : {Vec3(1, 1, 1), Vec3(1, 2, 3), Vec3(0, 1, 2), Vec3(3, 0.5, 1)}) {
    const Vec3 out = from.normalized();
    start(0.003 * out, kBall);
    const Rendering& r = to(0.0007 * out);
    EXPECT_NEAR((r.force_N - 0.3 * out).norm(), 0, 2e-3) << from.transpose();
    EXPECT_NEAR(proxy().norm(), 0.001, 1e-6);
  }
}

// T6 with a ball: sliding over a sharp edge turns the force step by step.
TEST_P(BallTest, convex_edge_has_no_jump) {
  add(box(Vec3(-0.02, -0.02, -0.02), Vec3(0, 0.02, 0)), surface());
  start({-0.005, 0.0003, 0.003}, kBall);
  to({-0.005, 0.0003, 0.0006});
  Vec3 last = hand->now().force_N;
  to({0.003, 0.0003, 0.0006}, 0.02, [&](const Rendering& r) {
    EXPECT_LE((r.force_N - last).norm(), 0.06);
    last = r.force_N;
  });
  EXPECT_EQ(last.norm(), 0);
}

// T7 with a ball: a thin plate of fine cells at 5 m/s, on vertices and edges
TEST_P(BallTest, thin_plate_stops_it) {
  scene.faces = scene::TouchableFaces::both;
  const TriangleMesh plate = heightField(
      0.01, 40, [](double, double) { return 0.0; }, 0.3);
  add(plate, surface());
  std::mt19937 random(5);
  for (int i = 0; i < 60; ++i) {
    const Vec3 v = 0.7 * plate.vertices[random() % plate.vertices.size()].cast<double>();
    const Vec3 aim = i % 2 == 0 ? v : Vec3(plate.vertices[20 * 41 + 10 + random() % 20].cast<double>());
    start(aim + Vec3(0.0005, -0.0003, 0.004), kBall);
    to(aim + Vec3(-0.0005, 0.0003, -0.002), 5);
    EXPECT_NEAR(hand->now().force_N.z(), 3, 1e-3);
  }
}

// A ball that steps through a plate thinner than itself must not be thrown out of its other side: the hand
// would get more from the far spring than it gave to the near one.
TEST_P(BallTest, popthrough_of_a_thin_body_gives_no_energy) {
  scene.faces = scene::TouchableFaces::front;
  scene::Surface s = surface();
  s.damping_Ns_per_m = 0;
  s.popthrough_N = 0.4;
  TriangleMesh body = plane(0.05, 10);
  TriangleMesh lower = plane(0.05, 10);
  geometry::scaleAndMove(lower, 1, Vec3(0, 0, -0.0005));
  const auto first = static_cast<std::uint32_t>(body.vertices.size());
  body.vertices.insert(body.vertices.end(), lower.vertices.begin(), lower.vertices.end());
  for (const auto& t : lower.triangles) body.triangles.push_back({t[0] + first, t[2] + first, t[1] + first});
  add(body, s);
  start({0.0013, 0.0021, 0.003}, kBall);
  double work = 0;
  double most_N = 0;
  Vec3 force = Vec3::Zero();
  Vec3 place = hip();
  const auto book = [&](const Rendering& r) {
    most_N = std::max(most_N, r.force_N.norm());
    work += 0.5 * (force + r.force_N).dot(hip() - place);
    force = r.force_N;
    place = hip();
  };
  to({0.0013, 0.0021, -0.006}, 0.01, book);
  EXPECT_NEAR(most_N, 0.4 + 0.5, 0.011) << "the far side is in its way for another half millimetre";
  EXPECT_EQ(force.norm(), 0) << "it popped through";
  to({0.0013, 0.0021, 0.003}, 0.01, book);
  EXPECT_LE(work, 1e-6);
}

// A body of many sides and one of two: neither pushes a ball on that has just got through, and both let it go
// at the limit when it turns back at once.
TEST_P(BallTest, popthrough_lets_go_at_its_force_in_both_directions) {
  scene.faces = scene::TouchableFaces::both;
  scene::Surface s = surface();
  for (const double limit_N : {0.3, 0.9, 1.4}) {
    for (const double thickness : {0.04, 0.001}) {
      scene = SceneFixture();
      scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
      scene.faces = scene::TouchableFaces::both;
      s.popthrough_N = limit_N;
      add(box({-0.03, -0.03, -thickness}, {0.03, 0.03, 0}), s);
      start({0.0013, 0.0021, 0.003}, kBall);
      // Beyond the ball's room behind the near side, the far side of the thin box is in its way.
      const double most_N = limit_N + (thickness < 0.002 ? thickness * s.stiffness_N_per_m : 0) + 0.02;
      for (int round = 0; round < 3; ++round) {
        bool through = false;
        const auto pressed = [&](const Rendering& r) {
          if (std::exchange(through, through || (r.status & kRenderPopthrough) != 0)) return;
          EXPECT_GE(r.force_N.z(), -0.02) << limit_N << " N, " << thickness << " m";
          EXPECT_LE(r.force_N.z(), most_N) << limit_N << " N, " << thickness << " m";
        };
        double z = 0.003;
        while (!through && z > -0.006) to({0.0013, 0.0021, z -= 1e-5}, 0.01, pressed);
        ASSERT_TRUE(through) << limit_N << " N, " << thickness << " m";
        EXPECT_LE(hand->now().force_N.norm(), 0.02) << "room for the ball at once";
        double pull_N = 0;
        to({0.0013, 0.0021, 0.004}, 0.01,
           [&](const Rendering& r) { pull_N = std::max(pull_N, -r.force_N.z()); });
        EXPECT_LE(pull_N, most_N) << limit_N << " N, " << thickness << " m";
        EXPECT_EQ(hand->now().force_N.norm(), 0) << "it is out again";
      }
    }
  }
}

// A ball of 3 mm that came through a surface from behind.
constexpr RenderOptions kLargeBall{.toolRadius_m = 0.003};

struct SheetForm {
  const char* name;
  double (*z)(double x, double y);
};
const std::vector<SheetForm> kSheetForms{{"flat", [](double, double) { return 0.0; }},
                                         {"hill", [](double x, double y) { return -25 * (x * x + y * y); }},
                                         {"bowl", [](double x, double y) { return 25 * (x * x + y * y); }},
                                         {"ridge", [](double x, double) { return -0.3 * std::abs(x); }},
                                         {"valley", [](double x, double) { return 0.3 * std::abs(x); }}};
const std::vector<Vec3> kWaysOut{{0, 0, 1}, {0.5, 0.2, 1}, {1, -0.3, 0.5}, {-0.4, 1, 0.25}, {1, 0.1, 0.12}};

// It overlaps faces in front of which its centre is. They do not hold it, and afterwards all of them hold it
// from the front.
TEST_P(BallTest, what_came_from_behind_is_not_held) {
  for (const SheetForm& sheet : kSheetForms) {
    for (const double friction : {0.0, 0.8}) {
      scene = SceneFixture();
      scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
      add(heightField(0.03, 60, sheet.z, 0.3), surface(1000, friction, friction));
      for (const Vec3& way : kWaysOut) {
        SCOPED_TRACE(std::string(sheet.name) + (friction > 0 ? ", friction, " : ", ") +
                     std::to_string(way.z()));
        const Vec3 through(0.0011, -0.0007, sheet.z(0.0011, -0.0007));
        start(through - 0.005 * way, kLargeBall);
        double most_N = 0;
        const auto book = [&](const Rendering& r) { most_N = std::max(most_N, r.force_N.norm()); };
        to(through + 0.004 * way, 0.02, book);
        to(hip() + Vec3(0, 0, 0.012), 0.02, book);
        EXPECT_LE(most_N, 0.02);
        // Down again: the ball rests a radius above the surface.
        const Vec3 above(0.0004, 0.0003, 0.0025);
        to({above.x(), above.y(), hip().z()}, 0.05);
        const Rendering& r = to(above, 0.02);
        EXPECT_GT(r.force_N.z(), 0.3);
        const Vec3 rest = proxy();
        const auto v = scene.snapshot()->objects[0]->mesh->vertices;
        double nearest = 1;
        for (const auto& x : *v) {
          const Vec3 at = x.cast<double>() / GetParam().worldUnitsPerMetre;
          nearest = std::min(nearest, (at - rest).norm());
        }
        EXPECT_GE(nearest, 0.003 - 1e-7);
      }
    }
  }
}

// A hand that turns back before the ball is out meets the surface where the ball is, without a jump: no
// deeper, and no higher.
TEST_P(BallTest, what_turns_back_half_way_is_held_where_it_is) {
  for (const SheetForm& sheet : kSheetForms) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    add(heightField(0.03, 60, sheet.z, 0.3), surface());
    for (const double top : {0.0003, 0.0012, 0.0027}) {
      SCOPED_TRACE(std::string(sheet.name) + ", " + std::to_string(top));
      const Vec3 foot(0.0011, -0.0007, sheet.z(0.0011, -0.0007));
      start(foot - Vec3(0, 0, 0.005), kLargeBall);
      to(foot + Vec3(0, 0, top), 0.02);
      Vec3 last = Vec3::Zero();
      double work_J = 0;
      Vec3 place = hip();
      to(foot - Vec3(0, 0, 0.002), 0.02, [&](const Rendering& r) {
        EXPECT_LE(r.force_N.norm(), 1000 * (foot.z() + top - hip().z()) + 1e-3);
        work_J += 0.5 * (last + r.force_N).dot(hip() - place);
        last = r.force_N;
        place = hip();
        EXPECT_GE(proxy().z() - sheet.z(proxy().x(), proxy().y()), -2e-5);
      });
      EXPECT_GT(last.z(), 1.5);
      if (sheet.z(1, 1) == 0) {
        EXPECT_NEAR(last.z(), 1000 * (top + 0.002), 1e-4);
      }
      to(foot + Vec3(0, 0, 0.012), 0.02, [&](const Rendering& r) {
        work_J += 0.5 * (last + r.force_N).dot(hip() - place);
        last = r.force_N;
        place = hip();
      });
      EXPECT_EQ(last.norm(), 0);
      EXPECT_LE(work_J, 1e-6);
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture

// The cases of the ground truth with a ball of 1 mm: T5b, T8, T9, T10, T17 … T20. The point stands beside
// them in contact_test, moving_test, object_test, friction_test and watertight_test.
#include <limits>

#include "base/time.h"
#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

constexpr double kToolRadius = 0.001;
constexpr RenderOptions kBallOfRadius{.toolRadius_m = kToolRadius};

TriangleMesh jittered(double half, int cells) {
  return heightField(
      half, cells, [](double, double) { return 0.0; }, 0.3);
}

class BallGroundTruth : public VariantTest {
 protected:
  double units() const { return GetParam().worldUnitsPerMetre; }
  void clear() {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(units());
  }
  Affine shifted(const scene::ObjectState& object, const Vec3& by_m) const {
    Affine t = object.motion.destination();
    t.pretranslate(units() * by_m);
    return t;
  }
};
INSTANTIATE_TEST_SUITE_P(, BallGroundTruth, kVariants, variantName);

// T5b  a shallow seam: the ball lies in it without a lag
TEST_P(BallGroundTruth, shallow_concave_seam_does_not_hold_the_proxy_back) {
  for (const double angle : {0.0003, 0.003, 0.03, 0.3}) {
    clear();
    add(heightField(0.05, 100, [&](double x, double) { return std::tan(angle / 2) * std::abs(x); }),
        surface());
    start({-0.01, 0.00023, 0.004}, kBallOfRadius);
    to({-0.01, 0.00023, -0.001});
    to({0.01, 0.00023, -0.001}, 0.05, [&](const Rendering& r) {
      const Vec3 h = hip();
      const double side = h.x() < 0 ? -1 : 1;
      const Vec3 n = Vec3(-side * std::sin(angle / 2), 0, std::cos(angle / 2));
      Vec3 nearest = h - n * (n.dot(h) - kToolRadius);
      if (nearest.x() * side < 0) nearest = Vec3(0, h.y(), kToolRadius / std::cos(angle / 2));
      EXPECT_LT((proxy() - nearest).norm(), 5e-6) << angle << " at " << h.x();
      EXPECT_EQ(r.status, 0U);
    });
  }
}

// T8  50 mm deep: F = 51 N, for the ball touches a radius early
TEST_P(BallGroundTruth, deep_press_is_not_released) {
  add(plane(0.1, 4), surface());
  start({0.001, 0.002, 0.005}, kBallOfRadius);
  EXPECT_NEAR(to({0.001, 0.002, -0.05}, 0.5).force_N.z(), 51, 1e-4);
}

// T9a  a plate rises at 50 mm/s into a HIP at rest
TEST_P(BallGroundTruth, rising_plate_lifts_a_resting_hand) {
  scene::ObjectState& object = add(jittered(0.02, 40), surface());
  object.motion = scene::Motion::between(object.motion.origin(), shifted(object, {0, 0, 0.004}),
                                         toNanos(0.01), toNanos(0.09));
  start({0.0003, 0.0002, 0.002}, kBallOfRadius);
  for (int i = 0; i < 120; ++i) {
    const double risen =
        0.05 * base::toSeconds(std::clamp<Nanos>(hand->time() - toNanos(0.01), 0, toNanos(0.08)));
    const Rendering& r = at({0.0003, 0.0002, 0.002});
    EXPECT_NEAR((r.force_N - Vec3(0, 0, 1000 * std::max(0.0, risen - 0.001))).norm(), 0, 1e-3) << i;
    EXPECT_EQ(r.status, 0U);
  }
}

// T9b  a plate slides under a pressed HIP: the proxy is carried until |Ft| = mu Fn, then slips
TEST_P(BallGroundTruth, sliding_plate_carries_the_proxy_until_it_slips) {
  scene::ObjectState& object = add(plane(0.05, 10), surface(1000, 0.5, 0.5));
  start({0.0003, 0.0002, 0.002}, kBallOfRadius);
  to({0.0003, 0.0002, -0.001});
  const Nanos begin = hand->time();
  object.motion = scene::Motion::between(object.motion.origin(), shifted(object, {0.005, 0, 0}), begin,
                                         begin + toNanos(0.25));
  hand->show(scene.snapshot());
  for (int i = 0; i < 240; ++i) {
    const double went = 0.02 * base::toSeconds(hand->time() - begin);
    const Rendering& r = at({0.0003, 0.0002, -0.001});
    EXPECT_NEAR(r.force_N.x(), std::min(1000 * went, 1.0), 0.02) << i;
    EXPECT_NEAR(r.force_N.z(), 2, 1e-3);
  }
}

// T9c  poses at 60 Hz, each is the goal of an interpolated motion: no steps at 60 Hz
TEST_P(BallGroundTruth, interpolated_pose_stream_has_no_steps) {
  scene::ObjectState& object = add(plane(0.05, 20), surface());
  const auto height = [](double t) { return 0.002 * std::sin(M_PI * std::max(0.0, t)); };
  const Affine home = object.motion.destination();
  const auto pose = [&](double t) {
    Affine p = home;
    p.pretranslate(units() * Vec3(0, 0, height(t)));
    return p;
  };
  start({0.001, 0.002, 0.002}, kBallOfRadius);
  to({0.001, 0.002, -0.002});
  constexpr double kInterval_s = 1.0 / 60;
  const double begin = base::toSeconds(hand->time());
  double next = begin;
  double before_N = hand->now().force_N.z();
  for (int i = 0; i < 1000; ++i) {
    const double t = base::toSeconds(hand->time());
    if (t >= next) {
      object.motion = scene::Motion::between(pose(next - begin - kInterval_s), pose(next - begin),
                                             toNanos(next), toNanos(next + kInterval_s));
      hand->show(scene.snapshot());
      next += kInterval_s;
    }
    const double felt_N = at({0.001, 0.002, -0.002}).force_N.z();
    EXPECT_NEAR(felt_N, 1000 * (0.003 + height(t - begin - kInterval_s)), 0.05);
    EXPECT_LE(std::abs(felt_N - before_N), 1000 * 0.002 * M_PI * 1e-3 + 1e-3);
    before_N = felt_N;
  }
}

// T9d  the vertices under the HIP rise by 1 mm in 100 ms
TEST_P(BallGroundTruth, deforming_surface_is_felt_like_a_moving_one) {
  TriangleMesh mesh = jittered(0.02, 60);
  geometry::scaleAndMove(mesh, units(), Vec3::Zero());
  std::vector<geometry::Vec3f> risen = mesh.vertices;
  for (auto& v : risen) v.z() += static_cast<float>(units() * 0.001);
  const auto placed = scene::Motion::fixed(Affine(Eigen::Translation3d(units() * offset())));
  scene::ObjectState& object = scene.add(geometryOf(mesh, 5), surface(), placed);
  start({0.0003, 0.0002, 0.003}, kBallOfRadius);
  to({0.0003, 0.0002, 0.0005});
  const Nanos begin = hand->time();
  object.mesh = geometryOf(mesh, 5, &risen, begin, begin + toNanos(0.1));
  hand->show(scene.snapshot());
  for (int i = 0; i < 150; ++i) {
    const double s = std::min(1.0, base::toSeconds(hand->time() - begin) / 0.1);
    const Rendering& r = at({0.0003, 0.0002, 0.0005});
    EXPECT_NEAR((r.force_N - Vec3(0, 0, 0.5 + s)).norm(), 0, 0.02) << i;
  }
}

// T10  the same slope in cells of 2 … 0.1 mm: the same forces within 1 %
TEST_P(BallGroundTruth, cell_size_is_not_felt) {
  for (const double cell : {0.002, 0.0005, 0.0002, 0.0001}) {
    clear();
    const double half = 0.006;
    add(heightField(
            half, static_cast<int>(2 * half / cell), [](double x, double y) { return 0.3 * x + 0.1 * y; },
            0.3),
        surface());
    const Vec3 n = Vec3(-0.3, -0.1, 1).normalized();
    const Vec3 from(-0.003, 0.0006, 0.3 * -0.003 + 0.1 * 0.0006);
    start(from + 0.003 * n, kBallOfRadius);
    to(from);
    to(from + Vec3(0.006, 0.0012, 0.3 * 0.006 + 0.1 * 0.0012), 0.05, [&](const Rendering& r) {
      EXPECT_NEAR(r.force_N.norm(), 1, 0.01) << cell;
      EXPECT_GT(r.force_N.normalized().dot(n), 0.9999) << cell;
      EXPECT_EQ(r.status, 0U);
    });
  }
}

// T17  shear in the transform: the same forces as from a mesh with sheared vertices; the ball stays a ball
TEST_P(BallGroundTruth, shear_in_the_transform_equals_shear_in_the_mesh) {
  geometry::Mat3 shear;
  shear << 1.5, 0.3, 0.2, 0, 0.6, 0.1, 0.1, 0, 0.9;
  TriangleMesh byHand = sphere(0.03, 24);
  for (auto& v : byHand.vertices) v = (shear * v.cast<double>()).cast<float>();
  add(byHand, surface());
  Hand first(scene.snapshot(), kBallOfRadius);
  clear();
  Affine placed(Eigen::Translation3d(units() * offset()));
  placed.linear() = units() * shear;
  scene.add(sphere(0.03, 24), surface(), placed);
  Hand second(scene.snapshot(), kBallOfRadius);
  for (int i = 0; i < 400; ++i) {
    const double a = 0.002 * i;
    const double reach = 1.2 - 0.3 * std::min(1.0, i / 100.0);
    const Vec3 p = offset() + reach * shear * (0.03 * Vec3(std::cos(a), 0.3, std::sin(a)).normalized());
    const Vec3 f = first.at(p).force_N;
    EXPECT_NEAR((second.at(p).force_N - f).norm(), 0, 0.01 * f.norm() + 1e-4) << i;
    if (i > 100) {
      EXPECT_GT(f.norm(), 0.5);
    }
  }
}

// T18  a valid plate among duplicate, flipped, degenerate and infinite triangles
TEST_P(BallGroundTruth, soup_neither_tunnels_nor_breaks) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> across(-0.018, 0.018);
  TriangleMesh soup = plane(0.02, 20);
  const auto sound = soup.triangles;
  const auto bad = static_cast<std::uint32_t>(soup.vertices.size());
  soup.vertices.push_back(geometry::Vec3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  soup.vertices.push_back(geometry::Vec3f::Constant(std::numeric_limits<float>::infinity()));
  for (int i = 0; i < 60; ++i) {
    const auto& t = sound[random() % sound.size()];
    const auto middle = static_cast<std::uint32_t>(soup.vertices.size());
    soup.vertices.push_back(0.5F * (soup.vertices[t[0]] + soup.vertices[t[1]]));
    soup.triangles.insert(soup.triangles.end(), {t,
                                                 {t[0], t[2], t[1]},
                                                 {t[0], t[0], t[1]},
                                                 {t[0], t[1], bad + static_cast<std::uint32_t>(i % 2)},
                                                 {t[0], middle, t[2]}});
  }
  for (const auto faces : {scene::TouchableFaces::front, scene::TouchableFaces::both}) {
    clear();
    scene.faces = faces;
    add(soup, surface(1000, 0.3, 0.3));
    start({0.001, 0.002, 0.004}, kBallOfRadius);
    to({0.001, 0.002, 0});
    for (int k = 0; k < 40; ++k) {
      to({across(random), across(random), 0}, 0.2, [&](const Rendering& r) {
        EXPECT_TRUE(r.force_N.allFinite());
        EXPECT_GT(proxy().z(), kToolRadius - 1e-8);
        EXPECT_NEAR(r.normalForce_N.z(), 1.0, 1e-3);
      });
    }
  }
}

// T19  two abutting plates of different friction: no kick at the seam
TEST_P(BallGroundTruth, seam_between_objects_changes_friction_without_a_kick) {
  const auto plate = [](float from, float to) {
    TriangleMesh mesh;
    mesh.vertices = {{from, -0.02F, 0}, {to, -0.02F, 0}, {to, 0.02F, 0}, {from, 0.02F, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
  };
  add(plate(-0.02F, 0), surface(1000, 0.6, 0.6));
  add(plate(0, 0.02F), surface(1000, 0.1, 0.1));
  start({-0.01, 0.0003, 0.003}, kBallOfRadius);
  to({-0.01, 0.0003, 0});
  double before = 0;
  double after = 0;
  to({0.01, 0.0003, 0}, 0.02, [&](const Rendering& r) {
    EXPECT_NEAR(r.normalForce_N.z(), 1.0, 1e-3);
    EXPECT_NEAR(r.normalForce_N.head<2>().norm(), 0, 1e-4);
    if (proxy().x() < -1e-5) before = -r.force_N.x();
    if (proxy().x() > 1e-3) after = -r.force_N.x();
  });
  EXPECT_NEAR(before, 0.6, 0.012);
  EXPECT_NEAR(after, 0.1, 0.002);
}

// T20  the touched object vanishes: its contact ends, and the status reports the jump to the guard
TEST_P(BallGroundTruth, vanishing_object_ends_its_contact_only) {
  add(plane(0.05, 10), surface());
  const SceneFixture below = scene;
  scene::ObjectState& upper = add(plane(0.05, 7), surface());
  upper.motion = scene::Motion::fixed(shifted(upper, {0, 0, 0.001}));
  start({0.001, 0.002, 0.004}, kBallOfRadius);
  EXPECT_NEAR(to({0.001, 0.002, 0}).force_N.z(), 2, 1e-3);
  scene = below;
  hand->show(scene.snapshot());
  EXPECT_NEAR(at({0.001, 0.002, 0}).force_N.z(), 1, 1e-3);
  EXPECT_NE(hand->now().status & kRenderGeometryJump, 0U);
  clear();
  hand->show(scene.snapshot());
  EXPECT_EQ(at({0.001, 0.002, 0}).force_N.norm(), 0);
  EXPECT_NE(hand->now().status & kRenderGeometryJump, 0U);
}

// Force shading smooths a coarse mesh but keeps sharp edges.
TEST_P(BallGroundTruth, shading_is_off_at_sharp_edges) {
  for (const double radius : {0.0, kToolRadius}) {
    clear();
    add(box(Vec3(-0.02, -0.02, -0.02), Vec3(0.02, 0.02, 0)), surface());
    const RenderOptions options{.toolRadius_m = radius, .forceShading = true};
    start({-0.019, 0.003, 0.003}, options);
    to({-0.019, 0.003, radius - 0.001});
    to({0.0199, 0.0031, radius - 0.001}, 0.05,
       [&](const Rendering& r) { EXPECT_NEAR((r.force_N - Vec3(0, 0, 1)).norm(), 0, 1e-3) << hip().x(); });
  }
}

// Around a sharp edge, the ball is pushed away from the edge.
TEST_P(BallGroundTruth, shading_turns_nothing_at_the_edge_of_a_box) {
  add(box(Vec3(-0.02, -0.02, -0.02), Vec3(0.02, 0.02, 0)), surface());
  start({0.024, 0.003, 0.004}, RenderOptions{.toolRadius_m = 0.003, .forceShading = true});
  const auto outOf = [](double angle) -> Vec3 { return {std::cos(angle), 0, std::sin(angle)}; };
  const auto around = [&](double angle) -> Vec3 { return Vec3(0.02, 0.003, 0) + 0.002 * outOf(angle); };
  to(around(0.05));
  for (double angle = 0.05; angle < 0.5 * M_PI - 0.05; angle += 0.01)
    EXPECT_LT((at(around(angle)).force_N - outOf(angle)).norm(), 0.02) << angle;
}

// A place beside a post around the z axis; `side` counts its sides.
Vec3 onPost(double side, int sides, double r, double z) {
  const double angle = 2 * M_PI * side / sides;
  return {r * std::cos(angle), r * std::sin(angle), z};
}

TriangleMesh roundPost(int sides) {
  constexpr double kRadius = 0.02;
  TriangleMesh post;
  post.vertices.push_back(Vec3f::Zero());
  for (int i = 0; i < sides; ++i) {
    post.vertices.push_back(onPost(i, sides, kRadius, 0).cast<float>());
    post.vertices.push_back(onPost(i, sides, kRadius, -0.03).cast<float>());
    const auto a = static_cast<std::uint32_t>(1 + 2 * i);
    const auto b = static_cast<std::uint32_t>(1 + 2 * ((i + 1) % sides));
    post.triangles.insert(post.triangles.end(), {{0, a, b}, {a + 1, b + 1, b}, {a + 1, b, a}});
  }
  return post;
}

// Around the post: from its faces to its edges and back, the direction goes on.
TEST_P(BallGroundTruth, shading_turns_smoothly_around_a_post) {
  for (const int sides : {9, 24, 100}) {
    clear();
    add(roundPost(sides), surface());
    const auto at_m = [sides](double side) { return onPost(side, sides, 0.0225, -0.0113); };
    start(1.5 * at_m(0), RenderOptions{.toolRadius_m = 0.004, .forceShading = true});
    to(at_m(0));
    Vec3 last = hand->now().force_N.normalized();
    for (double side = 0; side < 3; side += 0.01) {
      const Vec3 direction = at(at_m(side)).force_N.normalized();
      EXPECT_LT((direction - last).norm(), 0.02) << sides << " sides, at " << side;
      last = direction;
    }
  }
}

// From the side of a round post over its rim to its top: the side is shaded, the rim is not, and the force
// turns without a step. The angle of the sides around the post is one in the middle of none.
TEST_P(BallGroundTruth, shading_ends_gradually_over_a_sharp_rim) {
  const TriangleMesh post = roundPost(24);
  const auto onRim = [](double side, double r, double z) { return onPost(side, 24, r, z); };
  for (const double side : {0.0, 0.02, 0.3, 0.5, 0.9}) {
    clear();
    add(post, surface());
    start(onRim(side, 0.026, -0.01), RenderOptions{.toolRadius_m = 0.003, .forceShading = true});
    to(onRim(side, 0.0215, -0.01));
    to(onRim(side, 0.0215, 0), 0.01);
    Vec3 last = hand->now().force_N;
    for (double angle = 0; angle < 0.5 * M_PI; angle += 0.002) {
      const Vec3 force = at(onRim(side, 0.02 + 0.0015 * std::cos(angle), 0.0015 * std::sin(angle))).force_N;
      EXPECT_LT((force - last).norm(), 0.02) << side << " at " << angle;
      last = force;
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture

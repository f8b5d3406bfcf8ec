// Geometry that moves, deforms, jumps and disappears under the HIP: T9a, T9c, T9d, T20 of the ground truth
// (T9b is in friction_test).
#include "base/time.h"
#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

class MovingTest : public VariantTest {
 protected:
  double units() const { return GetParam().worldUnitsPerMetre; }
  Affine shifted(const scene::ObjectState& object, const Vec3& by_m) const {
    Affine t = object.motion.destination();
    t.pretranslate(units() * by_m);
    return t;
  }
};
INSTANTIATE_TEST_SUITE_P(, MovingTest, kVariants, variantName);

// T9a      o   a HIP at rest, 1 mm above
//       =======   a plate rising at 50 mm/s by 4 mm: F = k d(t), one step per tick of at most k v T
TEST_P(MovingTest, rising_plate_lifts_a_resting_hand) {
  for (const auto faces : {scene::TouchableFaces::front, scene::TouchableFaces::both}) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(units());
    scene.faces = faces;
    scene::ObjectState& object = add(heightField(
                                         0.02, 40, [](double, double) { return 0.0; }, 0.3),
                                     surface());
    object.motion = scene::Motion::between(object.motion.origin(), shifted(object, {0, 0, 0.004}),
                                           toNanos(0.01), toNanos(0.09));
    start({0.0003, 0.0002, 0.001});
    for (int i = 0; i < 120; ++i) {
      const double risen =
          0.05 * base::toSeconds(std::clamp<Nanos>(hand->time() - toNanos(0.01), 0, toNanos(0.08)));
      const Rendering& r = at({0.0003, 0.0002, 0.001});
      EXPECT_NEAR((r.force_N - Vec3(0, 0, 1000 * std::max(0.0, risen - 0.001))).norm(), 0, 1e-3) << i;
      EXPECT_EQ(r.status, 0U);
    }
  }
}

// Damping is relative to the moving surface: a HIP at rest above a rising plate is damped as an approaching
// one.
TEST_P(MovingTest, rising_plate_is_damped) {
  scene::Surface s = surface();
  s.damping_Ns_per_m = 2;
  scene::ObjectState& object = add(plane(0.02, 10), s);
  object.motion =
      scene::Motion::between(object.motion.origin(), shifted(object, {0, 0, 0.01}), 0, toNanos(0.1));
  start({0.0003, 0.0002, 0.001});
  for (int i = 0; i < 25; ++i) at({0.0003, 0.0002, 0.001});
  const double depth = 0.1 * base::toSeconds(hand->time()) - 0.001;
  EXPECT_NEAR(at({0.0003, 0.0002, 0.001}).force_N.z(), 1000 * depth + 2 * 0.1, 2e-3);
}

// A thin sheet that moves 20 mm in one tick does not pass through the HIP.
TEST_P(MovingTest, fast_sheet_does_not_pass_through_the_hand) {
  scene.faces = scene::TouchableFaces::both;
  scene::ObjectState& object = add(plane(0.02, 10), surface());
  object.motion =
      scene::Motion::between(shifted(object, {0, 0, -0.005}), shifted(object, {0, 0, 0.015}), 0, kTick);
  start({0.0003, 0.0002, 0.001});
  EXPECT_NEAR(at({0.0003, 0.0002, 0.001}).force_N.z(), 14, 1e-3);
}

// T9c  poses at 60 Hz, each is the goal of an interpolated motion: no steps at 60 Hz
TEST_P(MovingTest, interpolated_pose_stream_has_no_steps) {
  scene::ObjectState& object = add(plane(0.05, 20), surface());
  const Affine home = object.motion.destination();
  const auto height = [](double t) { return 0.002 * std::sin(2 * M_PI * 0.5 * t); };
  const auto pose = [&](double t) {
    Affine p = home;
    p.pretranslate(units() * Vec3(0, 0, height(t)));
    return p;
  };
  start({0.001, 0.002, 0.001});
  to({0.001, 0.002, -0.003});
  const double interval = 1.0 / 60;
  double next = base::toSeconds(hand->time());
  double previousForce = hand->now().force_N.z();
  double t0 = next;
  for (int i = 0; i < 1000; ++i) {
    const double t = base::toSeconds(hand->time());
    if (t >= next) {
      object.motion = scene::Motion::between(pose(std::max(0.0, next - t0 - interval)), pose(next - t0),
                                             toNanos(next), toNanos(next + interval));
      hand->show(scene.snapshot());
      next += interval;
    }
    const Rendering& r = at({0.001, 0.002, -0.003});
    const double delayed = height(std::max(0.0, t - t0 - interval));
    EXPECT_NEAR(r.force_N.z(), 1000 * (0.003 + delayed), 0.05);
    EXPECT_LE(std::abs(r.force_N.z() - previousForce), 1000 * 0.002 * M_PI * 1e-3 + 1e-3);
    previousForce = r.force_N.z();
  }
}

// T9d  the vertices under the HIP rise by 1 mm in 100 ms, as a hump or as a whole
TEST_P(MovingTest, deforming_surface_is_felt_like_a_moving_one) {
  for (const double depth : {-0.0004, 0.0005}) {  // the hand is above, or already in contact
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(units());
    TriangleMesh mesh = heightField(
        0.02, 100, [](double, double) { return 0.0; }, 0.3);
    geometry::scaleAndMove(mesh, units(), Vec3::Zero());
    std::vector<geometry::Vec3f> risen = mesh.vertices;
    const auto hump = [&](double x, double y) {
      return 0.001 * std::exp(-(x * x + y * y) / (0.005 * 0.005));
    };
    for (auto& v : risen) {
      v.z() += static_cast<float>(units() * hump(v.x() / units(), v.y() / units()));
    }
    const auto placed = scene::Motion::fixed(Affine(Eigen::Translation3d(units() * offset())));
    scene::ObjectState& object = scene.add(geometryOf(mesh, 5), surface(), placed);
    start({0.0003, 0.0002, 0.001});
    to({0.0003, 0.0002, -depth});
    const Nanos begin = hand->time();
    object.mesh = geometryOf(mesh, 5, &risen, begin, begin + toNanos(0.1));
    hand->show(scene.snapshot());
    double last = hand->now().force_N.z();
    for (int i = 0; i < 150; ++i) {
      if (i == 120) {  // it comes to rest as an ordinary mesh
        TriangleMesh rest = mesh;
        rest.vertices = risen;
        object.mesh = geometryOf(rest, 5);
        hand->show(scene.snapshot());
      }
      const double s = std::min(1.0, base::toSeconds(hand->time() - begin) / 0.1);
      const Rendering& r = at({0.0003, 0.0002, -depth});
      const double d = std::max(0.0, depth + s * hump(0.0003, 0.0002));
      EXPECT_NEAR(r.force_N.norm(), 1000 * d, 0.02) << i;
      EXPECT_LE(std::abs(r.force_N.z() - last), 0.05);
      EXPECT_EQ(r.status, 0U);
      last = r.force_N.z();
    }
    EXPECT_NEAR(last, 1000 * (depth + 0.001), 0.02);
  }
}

// Triangles of metres: their far corners move by centimetres, what is near the hand by half a millimetre.
TEST_P(MovingTest, large_triangles_that_deform_lift_the_hand) {
  for (const double radius : {0.0, 0.002}) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(units());
    TriangleMesh mesh = plane(1.5);
    geometry::scaleAndMove(mesh, units(), Vec3::Zero());
    std::vector<geometry::Vec3f> tilted = mesh.vertices;
    for (auto& v : tilted) v.z() += static_cast<float>(0.02) * v.x();
    const auto placed = scene::Motion::fixed(Affine(Eigen::Translation3d(units() * offset())));
    scene::ObjectState& object = scene.add(geometryOf(mesh, 5), surface(), placed);
    start({0.05, 0.0002, radius + 0.0005}, {.toolRadius_m = radius});
    const Nanos begin = hand->time();
    const auto morph = geometryOf(mesh, 5, &tilted, begin, begin + toNanos(0.016));
    morph->before = morph->vertices;
    object.mesh = morph;
    hand->show(scene.snapshot());
    for (int i = 0; i < 30; ++i) at({0.05, 0.0002, radius + 0.0005});
    EXPECT_NEAR(hand->now().force_N.z(), 0.5, 0.01) << "ball " << radius;
  }
}

// The renderer reuses facets of objects at rest while the scene is the same. With a new snapshot of the same
// scene in every tick it can reuse nothing: the forces must be equal to the last bit.
TEST_P(MovingTest, facets_that_are_kept_change_no_byte) {
  for (const double radius : {0.0, 0.001}) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(units());
    TriangleMesh rough = sphere(0.02, 30);
    for (auto& v : rough.vertices) v *= static_cast<float>(1 + 0.02 * std::sin(7e3 * v.x() * v.y() / 0.02));
    add(rough, surface(1000, 0.3, 0.2));
    scene::ObjectState& plate = add(plane(0.03, 30), surface());
    plate.motion = scene::Motion::between(shifted(plate, {0, 0, 0.018}), shifted(plate, {0, 0.003, 0.0195}),
                                          toNanos(0.2), toNanos(0.5));
    Hand keeps(scene.snapshot(), {.toolRadius_m = radius});
    Hand makes(scene.snapshot(), {.toolRadius_m = radius});
    for (int i = 0; i < 800; ++i) {
      const double turn = 0.004 * i;
      const double distance = 0.018 + radius + 0.004 * std::max(0.0, 1 - i / 50.0);
      const Vec3 hip =
          offset() + distance * Vec3(0.4 * std::cos(turn), 0.4 * std::sin(3 * turn), 1).normalized();
      const Rendering& a = keeps.at(hip);
      makes.show(scene.snapshot());
      const Rendering& b = makes.at(hip);
      ASSERT_EQ(a.force_N, b.force_N) << i;
      ASSERT_EQ(a.proxy_m, b.proxy_m) << i;
      if (i > 60) {
        ASSERT_TRUE(a.touching) << i;
      }
    }
  }
}

// A drum rotates under a pressed HIP with high friction: the proxy rotates with it.
TEST_P(MovingTest, turning_object_carries_a_sticking_proxy) {
  scene::ObjectState& object = add(sphere(0.03, 40), surface(1000, 5, 5));
  Affine turned = object.motion.origin();
  turned.rotate(Eigen::AngleAxisd(0.05, Vec3::UnitY()));
  object.motion = scene::Motion::between(object.motion.origin(), turned, toNanos(0.1), toNanos(0.2));
  start({0.0003, 0.0002, 0.032});
  to({0.0003, 0.0002, 0.029});
  while (hand->time() < toNanos(0.1)) at({0.0003, 0.0002, 0.029});
  const Vec3 held = proxy();
  while (hand->time() < toNanos(0.22)) at({0.0003, 0.0002, 0.029});
  EXPECT_NEAR((proxy() - Eigen::AngleAxisd(0.05, Vec3::UnitY()) * held).norm(), 0, 1e-7);
}

// The view turns about the hand, as a client walks through a landscape: the rim of an open floor of metres
// moves by centimetres in a tick, what is near the hand by what it rises.
TEST_P(MovingTest, view_that_turns_lifts_the_hand_above_a_large_floor) {
  for (const auto faces : {scene::TouchableFaces::front, scene::TouchableFaces::both}) {
    for (const double radius : {0.0, 0.002}) {
      scene = SceneFixture();
      scene.setWorldUnitsPerMetre(units());
      scene.faces = faces;
      add(plane(3, 4), surface());
      start({0.0003, 0.0002, radius + 0.0005}, {.toolRadius_m = radius});
      const Affine first = scene.workspace.T_device_world;
      for (int frame = 1; frame <= 20; ++frame) {
        const double rise = 0.0002 * frame;
        const Eigen::AngleAxisd turn(0.02 * frame, Vec3::UnitZ());
        scene.workspace.T_device_world = Eigen::Translation3d(offset() + Vec3(0, 0, rise)) * turn *
                                         Eigen::Translation3d(-offset()) * first;
        scene.workspace.T_world_device = scene.workspace.T_device_world.inverse();
        hand->show(scene.snapshot());
        for (int i = 0; i < 16; ++i) at({0.0003, 0.0002, radius + 0.0005});
        EXPECT_NEAR(hand->now().force_N.z(), 1000 * std::max(0.0, rise - 0.0005), 0.02)
            << "frame " << frame << " ball " << radius;
      }
    }
  }
}

// A small jump of the touched object takes the proxy along and sets the status bit; a large one ends the
// contact.
TEST_P(MovingTest, jumps_are_reported) {
  scene::ObjectState& object = add(plane(0.05, 10), surface());
  start({0.001, 0.002, 0.001});
  to({0.001, 0.002, -0.001});
  object.motion = scene::Motion::fixed(shifted(object, {0, 0, 0.0005}), 1);
  hand->show(scene.snapshot());
  EXPECT_NEAR(at({0.001, 0.002, -0.001}).force_N.z(), 1.5, 1e-3);
  EXPECT_NE(hand->now().status & kRenderGeometryJump, 0U);
  EXPECT_EQ(at({0.001, 0.002, -0.001}).status, 0U);
  object.motion = scene::Motion::fixed(shifted(object, {0, 0, 0.05}), 2);
  hand->show(scene.snapshot());
  EXPECT_EQ(at({0.001, 0.002, -0.001}).force_N.norm(), 0);
  EXPECT_NE(hand->now().status & kRenderGeometryJump, 0U);
  EXPECT_FALSE(hand->now().touching);
}

// T20  the touched object disappears: no force, and a status bit for the guard; the object below still
// holds
TEST_P(MovingTest, vanishing_object_ends_its_contact_only) {
  add(plane(0.05, 10), surface());
  scene::ObjectState& upper = add(plane(0.05, 7), surface());
  upper.motion = scene::Motion::fixed(shifted(upper, {0, 0, 0.001}));
  start({0.001, 0.002, 0.002});
  EXPECT_NEAR(to({0.001, 0.002, -0.001}).force_N.z(), 2, 1e-3);
  SceneFixture below;
  below.setWorldUnitsPerMetre(units());
  scene = below;
  add(plane(0.05, 10), surface());
  hand->show(scene.snapshot());
  EXPECT_NEAR(at({0.001, 0.002, -0.001}).force_N.z(), 1, 1e-3);
  EXPECT_NE(hand->now().status & kRenderGeometryJump, 0U);
  scene = below;
  hand->show(scene.snapshot());
  EXPECT_EQ(at({0.001, 0.002, -0.001}).force_N.norm(), 0);
  EXPECT_NE(hand->now().status & kRenderGeometryJump, 0U);
}

// A rough ball tumbles or deforms at random while the HIP pokes at random: a proxy that starts outside stays
// outside.
class Tumble : public testing::TestWithParam<std::tuple<bool, double>> {
 protected:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  Vec3 anywhere(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  std::vector<geometry::Vec3f> roughened(std::vector<geometry::Vec3f> vertices, double by) {
    for (auto& v : vertices) v *= static_cast<float>(1 + by * uniform(-1, 1));
    return vertices;
  }
  // Star-shaped about the origin: inside is below the face that the ray through p meets.
  static bool isInside(const scene::MeshGeometry& mesh, const Vec3& p, Nanos now) {
    for (std::uint32_t t = 0; t < mesh.triangles->size(); ++t) {
      const scene::Corners k = mesh.corners(t, now);
      if (k.a.cross(k.b).dot(p) < 0 || k.b.cross(k.c).dot(p) < 0 || k.c.cross(k.a).dot(p) < 0) continue;
      if ((k.b - k.a).cross(k.c - k.a).dot(p - k.a) < 0) return true;
    }
    return false;
  }
  std::mt19937 random_{11};
};
INSTANTIATE_TEST_SUITE_P(, Tumble, testing::Combine(testing::Bool(), testing::Values(0.0, 0.001)),
                         [](const auto& test) {
                           return std::string(std::get<0>(test.param) ? "bending_" : "moving_") +
                                  (std::get<1>(test.param) > 0 ? "ball" : "point");
                         });

TEST_P(Tumble, proxy_stays_outside) {
  const auto [bends, radius] = GetParam();
  RenderOptions options;
  options.toolRadius_m = radius;
  int touching = 0;
  for (int round = 0; round < 12; ++round) {
    SceneFixture scene;
    scene.faces = round % 2 == 0 ? scene::TouchableFaces::front : scene::TouchableFaces::both;
    TriangleMesh mesh = sphere(0.02, 1 + round);
    mesh.vertices = roughened(mesh.vertices, 0.02 * round);
    const std::vector<geometry::Vec3f> first = mesh.vertices;
    std::vector<geometry::Vec3f> next = first;
    scene::ObjectState& object =
        scene.add(geometryOf(mesh, 3), surface(1000, round % 3 * 0.4, round % 3 * 0.3));
    Hand hand(scene.snapshot(), options);
    Vec3 hip(0, 0, 0.06);
    Vec3 goal = hip;
    hand.at(hip);
    Nanos end = 0;
    int left = 0;
    for (int i = 0; i < 1000; ++i) {
      const Nanos now = hand.time();
      if (now >= end) {
        const Nanos begin = std::exchange(end, now + toNanos(uniform(0.02, 0.1)));
        if (bends) {
          mesh.vertices = std::exchange(next, roughened(first, 0.15));
          object.mesh = geometryOf(mesh, 3, &next, now, end);
        } else {
          Affine pose(Eigen::Translation3d(anywhere(0.01)));
          pose.rotate(Eigen::AngleAxisd(uniform(-1, 1), anywhere(1).normalized())).scale(uniform(0.8, 1.2));
          object.motion = scene::Motion::between(object.motion.at(begin), pose, now, end);
        }
        hand.show(scene.snapshot());
      }
      if (left == 0) {
        goal = anywhere(0.03);
        left = 1 + static_cast<int>(random_() % 100);
      }
      hip += (goal - hip) / left--;
      const Rendering& r = hand.at(hip);
      touching += r.touching || (r.status & kRenderReleased) != 0 ? 1 : 0;
      // Many of the poses are jumps.
      ASSERT_EQ(r.status & ~(kRenderIterationLimit | kRenderGeometryJump | kRenderReleased), 0U)
          << "round " << round << " tick " << i;
      ASSERT_FALSE(isInside(*object.mesh, object.motion.at(now).inverse() * r.proxy_m, now))
          << "round " << round << " tick " << i;
    }
  }
  EXPECT_GT(touching, 3000);
}

}  // namespace
}  // namespace hapticd::realtime::fixture

// Placement, popthrough, damping and non-finite input: T15, T17 of the ground truth.
#include <limits>

#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

class ObjectTest : public VariantTest {};
INSTANTIATE_TEST_SUITE_P(, ObjectTest, kVariants, variantName);

// T15   o |   a two-sided plate gives way at 1.5 N, resists from behind, and gives way again
//         | o
TEST_P(ObjectTest, popthrough_gives_way_at_its_force) {
  scene.faces = scene::TouchableFaces::both;
  scene::Surface s = surface();
  s.popthrough_N = 1.5;
  add(plane(0.05, 10), s);
  start({0.0013, 0.0021, 0.001});
  double most = 0;
  for (const double side : {1.0, -1.0, 1.0}) {
    most = 0;
    bool popped = false;
    to({0.0013, 0.0021, -side * 0.002}, 0.01, [&](const Rendering& r) {
      most = std::max(most, side * r.force_N.z());
      if ((r.status & kRenderPopthrough) != 0) {
        EXPECT_FALSE(popped);
        popped = true;
        EXPECT_NEAR(hip().z(), -side * 0.0015, 0.00002);
      }
      if (popped) {
        EXPECT_EQ(r.force_N.norm(), 0);
      }
    });
    EXPECT_TRUE(popped);
    EXPECT_NEAR(most, 1.5, 0.03);
  }
}

// Two plates close together: the second does not give way before proxy and HIP have coincided again.
TEST_P(ObjectTest, popthrough_waits_until_proxy_and_hand_agree) {
  scene::Surface s = surface();
  s.popthrough_N = 1.0;
  add(plane(0.05, 10), s);
  s.popthrough_N = 0.2;
  TriangleMesh lower = plane(0.05, 10);
  geometry::scaleAndMove(lower, 1, Vec3(0, 0, -0.0005));
  add(lower, s);
  start({0.0013, 0.0021, 0.001});
  int pops = 0;
  to({0.0013, 0.0021, -0.003}, 0.01,
     [&](const Rendering& r) { pops += (r.status & kRenderPopthrough) != 0 ? 1 : 0; });
  EXPECT_EQ(pops, 1);
  EXPECT_NEAR(hand->now().force_N.z(), 2.5, 1e-3);
  // They coincide between the plates; from then on the lower plate gives way, too.
  to({0.0013, 0.0021, -0.0002}, 0.01);
  to({0.0013, 0.0021, -0.003}, 0.01,
     [&](const Rendering& r) { pops += (r.status & kRenderPopthrough) != 0 ? 1 : 0; });
  EXPECT_EQ(pops, 2);
  EXPECT_EQ(hand->now().force_N.norm(), 0);
}

// T17  shear and unequal scale in the transform: the same forces as from a mesh with sheared vertices
TEST_P(ObjectTest, shear_in_the_transform_equals_shear_in_the_mesh) {
  const double units = GetParam().worldUnitsPerMetre;
  geometry::Mat3 shear;
  shear << 1.5, 0.3, 0.2, 0, 0.6, 0.1, 0.1, 0, 0.9;
  TriangleMesh byHand = sphere(0.03, 40);
  for (auto& v : byHand.vertices) v = (shear * v.cast<double>()).cast<float>();
  add(byHand, surface());
  const auto byHandScene = scene.snapshot();
  scene = SceneFixture();
  scene.setWorldUnitsPerMetre(units);
  Affine placed(Eigen::Translation3d(units * offset()));
  placed.linear() = units * shear;
  scene.add(sphere(0.03, 40), surface(), placed);
  Hand first(byHandScene);
  Hand second(scene.snapshot());
  for (int i = 0; i < 600; ++i) {
    const double a = 0.002 * i;
    const double reach = 1.2 - 0.3 * std::min(1.0, i / 100.0);
    const Vec3 p = offset() + reach * shear * (0.03 * Vec3(std::cos(a), 0.3, std::sin(a)).normalized());
    const Vec3 f = first.at(p).force_N;
    EXPECT_NEAR((second.at(p).force_N - f).norm(), 0, 0.01 * f.norm() + 1e-4);
    if (i > 100) {
      EXPECT_GT(f.norm(), 0.5);
    }
  }
}

// A reflection in the placement keeps the outside outside.
TEST_P(ObjectTest, mirrored_object_keeps_its_outside) {
  const double units = GetParam().worldUnitsPerMetre;
  Affine mirrored(Eigen::Translation3d(units * offset()));
  mirrored.linear() = Vec3(-units, units, units).asDiagonal();
  scene.add(box(Vec3::Constant(-0.01), Vec3::Constant(0.01)), surface(), mirrored);
  start({0.0003, 0.0002, 0.012});
  EXPECT_NEAR(to({0.0003, 0.0002, 0.009}).force_N.z(), 1, 1e-3);
}

// Damping lowers the force of a leaving HIP, raises that of an approaching one, and never pulls.
TEST_P(ObjectTest, damping_never_pulls) {
  scene::Surface s = surface();
  s.damping_Ns_per_m = 2;
  add(plane(0.05, 10), s);
  start({0.0013, 0.0021, 0.001});
  to({0.0013, 0.0021, -0.001}, 0.1);
  EXPECT_NEAR(hand->now().force_N.z(), 1.0 + 0.2, 1e-3);
  at({0.0013, 0.0021, -0.001});
  EXPECT_NEAR(hand->now().force_N.z(), 1.0, 1e-3);
  EXPECT_NEAR(at({0.0013, 0.0021, -0.0009}).force_N.z(), 0.9 - 0.2, 1e-3);
  EXPECT_EQ(at({0.0013, 0.0021, -0.0002}).force_N.z(), 0);
}

// A shallow pit of so many faces around `centre`, open upwards; of two faces: a seam along y.
TriangleMesh pit(int faces, double slope, const Vec3& centre) {
  constexpr double kRadius_m = 0.05;
  const int sides = std::max(faces, 4);
  TriangleMesh mesh;
  mesh.vertices.push_back(centre.cast<float>());
  for (int i = 0; i < sides; ++i) {
    const double turn = 2 * EIGEN_PI * i / sides;
    const Vec3 out(std::cos(turn), std::sin(turn), 0);
    const double rise = faces == 2 ? std::abs(out.x()) : 1;
    mesh.vertices.push_back((centre + kRadius_m * (out + slope * rise * Vec3::UnitZ())).cast<float>());
  }
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(sides); ++i)
    mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % static_cast<std::uint32_t>(sides)});
  return mesh;
}

// However many faces a nearly flat surface has, it damps as a plane does.
TEST_P(ObjectTest, shallow_seams_and_pits_damp_as_a_plane) {
  scene::Surface s = surface();
  s.damping_Ns_per_m = 2;
  const int faces[] = {2, 4, 6, 7};
  for (int i = 0; i < 4; ++i) add(pit(faces[i], 0.02, Vec3(0.2 * i, 0, 0)), s);
  for (int i = 0; i < 4; ++i) {
    const Vec3 lowest(0.2 * i, 0, 0);
    start(lowest + Vec3(0, 0, 0.001));
    to(lowest - Vec3(0, 0, 0.001), 0.05);
    EXPECT_NEAR(hand->now().force_N.z(), 1.0 + 0.1, 2e-3) << faces[i] << " faces";
    EXPECT_NEAR(at(lowest - Vec3(0, 0, 0.001)).force_N.z(), 1.0, 2e-3);
  }
}

// A HIP that is not finite gives no force; the next finite one restarts the proxy.
TEST_P(ObjectTest, hand_that_is_not_finite_gives_no_force) {
  add(plane(0.05, 10), surface());
  start({0.001, 0.002, 0.001});
  to({0.001, 0.002, -0.001});
  EXPECT_EQ(at({std::numeric_limits<double>::quiet_NaN(), 0, 0}).force_N.norm(), 0);
  EXPECT_EQ(hand->now().status, kRenderNotFinite);
  EXPECT_EQ(at({0.001, 0.002, std::numeric_limits<double>::infinity()}).force_N.norm(), 0);
  EXPECT_EQ(at({0.001, 0.002, -0.001}).status & kRenderNotFinite,
            kRenderNotFinite);  // the velocity still is not
  EXPECT_EQ(at({0.001, 0.002, 0.001}).status, 0U);
  EXPECT_NEAR(at({0.001, 0.002, -0.001}).force_N.z(), 1, 1e-3);
}

// Two walls of one object press with 1.0 N each, 1.41 N in all, and a floor of another one with 1.2 N.
TEST_P(ObjectTest, touched_is_the_object_that_presses_hardest) {
  const auto wall = [](int axis) {
    TriangleMesh mesh = plane(0.05, 2);
    for (auto& v : mesh.vertices)
      v = axis == 0 ? geometry::Vec3f(v.z(), v.x(), v.y()) : geometry::Vec3f(v.y(), v.z(), v.x());
    return mesh;
  };
  add(plane(0.05, 2), surface());
  TriangleMesh corner = wall(0);
  const TriangleMesh other = wall(1);
  const auto first = static_cast<std::uint32_t>(corner.vertices.size());
  corner.vertices.insert(corner.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& t : other.triangles)
    corner.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  add(corner, surface());
  start({0.003, 0.003, 0.003});
  const Rendering& r = to({-0.001, -0.001, -0.0012});
  ASSERT_EQ(r.contactCount, 2U);
  for (std::uint32_t i = 0; i < r.contactCount; ++i)
    EXPECT_NEAR(r.contacts[i].force_N.norm(), r.contacts[i].object == 0 ? 1.2 : std::sqrt(2.0), 1e-2);
  EXPECT_EQ(r.touchedObject, 1);
}

// Many small objects around the HIP; only the touched one exerts a force.
TEST_P(ObjectTest, one_of_many_objects_is_felt) {
  const double units = GetParam().worldUnitsPerMetre;
  for (int i = 0; i < 400; ++i) {
    TriangleMesh cube = box(Vec3::Constant(-0.001), Vec3::Constant(0.001));
    geometry::scaleAndMove(cube, units, Vec3::Zero());
    const Vec3 centre(0.004 * (i % 20 - 10), 0.004 * (i / 20 - 10), 0);
    scene.add(cube, surface(), Affine(Eigen::Translation3d(units * (offset() + centre))));
  }
  start({0.0003, 0.0002, 0.003});
  EXPECT_NEAR(to({0.0003, 0.0002, 0.0005}).force_N.z(), 0.5, 1e-3);
  EXPECT_EQ(hand->now().touchedObject, 210);
  EXPECT_EQ(hand->now().status, 0U);
}

}  // namespace
}  // namespace hapticd::realtime::fixture

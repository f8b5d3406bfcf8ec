// Nothing passes through a face: T7, T14 and T18 of the ground truth.
#include <cstdlib>
#include <limits>

#include "realtime/render/contact_query.h"
#include "reduced.h"
#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

class WatertightTest : public VariantTest {
 protected:
  std::mt19937 random{7};
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); }
};
INSTANTIATE_TEST_SUITE_P(, WatertightTest, kVariants, variantName);

// T7   |  a plate 0.1 mm thick, hit at 0.1, 1 and 5 m/s, 300 times, 100 of them exactly at vertices and edges
//   -> |
TEST_P(WatertightTest, thin_plate_stops_a_fast_hand) {
  constexpr double kHalf = 0.02;
  constexpr int kCells = 40;
  TriangleMesh plate = heightField(
      kHalf, kCells, [](double, double) { return 0.0; }, 0.3);
  const TriangleMesh top = plate;
  const auto count = static_cast<std::uint32_t>(plate.vertices.size());
  for (const auto& v : top.vertices) plate.vertices.push_back(v - geometry::Vec3f(0, 0, 1e-4F));
  for (const auto& t : top.triangles) plate.triangles.push_back({t[0] + count, t[2] + count, t[1] + count});
  for (const auto faces : {scene::TouchableFaces::front, scene::TouchableFaces::both}) {
    scene.faces = faces;
    if (faces == scene::TouchableFaces::front) add(plate, surface());
    for (const double speed : {0.1, 1.0, 5.0}) {
      for (int i = 0; i < reduced(300); ++i) {
        const auto& t = top.triangles[random() % top.triangles.size()];
        const auto corner = [&](int k) {
          return Vec3(top.vertices[t[static_cast<std::size_t>(k)]].cast<double>());
        };
        Vec3 aim(uniform(-0.9, 0.9) * kHalf, uniform(-0.9, 0.9) * kHalf, 0);
        if (i % 6 == 0) aim = corner(0);
        if (i % 6 == 3) aim = corner(0) + uniform(0, 1) * (corner(1) - corner(0));
        if (aim.head<2>().cwiseAbs().maxCoeff() > 0.95 * kHalf) aim *= 0.9;  // else it may slide off the rim
        const Vec3 way(uniform(-0.4, 0.4), uniform(-0.4, 0.4), -1);
        const Vec3 start_m = aim - 0.003 * way;
        if (start_m.head<2>().cwiseAbs().maxCoeff() > kHalf) continue;
        start(start_m);
        to(aim + 0.002 * way, speed);
        EXPECT_GT(hand->now().force_N.z(), 1.9) << aim.transpose() << " along " << way.transpose();
        EXPECT_GT(proxy().z(), -1e-9);
      }
    }
  }
}

// T14  closed sphere, segments from outside to inside, a third aimed exactly at vertices, a third at edges
class SegmentsTest : public WatertightTest {};
INSTANTIATE_TEST_SUITE_P(, SegmentsTest, kVariants, variantName);

int segmentCount() {
#ifdef HAPTICD_SANITIZED
  return 10'000;
#else
  return std::getenv("HAPTICD_LONG") != nullptr ? 3'000'000 : 300'000;  // of each of the four variants
#endif
}

TEST_P(SegmentsTest, every_segment_into_a_closed_mesh_hits) {
  TriangleMesh mesh = sphere(0.05, 60);
  for (auto& v : mesh.vertices) v *= static_cast<float>(uniform(0.98, 1.02));
  add(mesh, surface());
  int misses = 0;
  int shots = 0;
  for (const auto faces : {scene::TouchableFaces::front, scene::TouchableFaces::both}) {
    scene.faces = faces;
    const auto snapshot = scene.snapshot();
    ContactQuery query(0);
    const auto newTick = [&] {
      query.beginTick({snapshot.get(), 0}, {snapshot.get(), 0}, Vec3::Zero());
      query.addObjectsNear(offset(), 1, offset() + Vec3(1, 0, 0));
    };
    newTick();
    while (shots < segmentCount() * (faces == scene::TouchableFaces::front ? 1 : 2) / 2) {
      // Where the corners are once they went through floats in the scene's unit.
      const auto& t = mesh.triangles[random() % mesh.triangles.size()];
      const auto corner = [&](int k) {
        return Vec3(query.object(0).T_device_object *
                    (*snapshot->objects[0]->mesh->vertices)[t[static_cast<std::size_t>(k)]].cast<double>());
      };
      const double u = uniform(0, 1);
      const double w = uniform(0, 1);
      Vec3 aim = corner(0);
      if (shots % 3 == 1) aim += u * (corner(1) - corner(0));
      if (shots % 3 == 2) aim += u * (1 - w) * (corner(1) - corner(0)) + w * (corner(2) - corner(0));
      const Vec3 inside = offset() + 0.025 * Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      const Vec3 way = (aim - inside).normalized();
      const Vec3 from = aim + uniform(0.003, 0.01) * way;
      if ((from - offset()).norm() < 0.052) continue;
      ++shots;
      ObjectHit hit;
      const bool endsOnTheFace = shots % 8 == 0;
      newTick();
      if (!query.cast(from, endsOnTheFace ? aim : Vec3(aim - 0.002 * way), hit) || hit.unexamined) ++misses;
    }
  }
  EXPECT_EQ(misses, 0) << "of " << shots;
}

// T18  a valid plate among duplicates, degenerates, flipped and crossing triangles, a T-junction, NaN and
// infinity
TEST_P(WatertightTest, soup_neither_tunnels_nor_breaks) {
  constexpr double kHalf = 0.02;
  constexpr int kCells = 20;
  TriangleMesh soup = plane(kHalf, kCells);
  const auto sound = soup.triangles;
  const auto soundVertices = static_cast<std::uint32_t>(soup.vertices.size());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  soup.vertices.push_back({nan, 0, 0});
  soup.vertices.push_back({inf, 0, 0});
  soup.vertices.push_back({0, -inf, nan});
  for (std::uint32_t i = 0; i < 60; ++i) {
    const auto& t = sound[random() % sound.size()];
    soup.triangles.push_back(t);                   // duplicate
    soup.triangles.push_back({t[0], t[2], t[1]});  // flipped
    soup.triangles.push_back({t[0], t[0], t[1]});  // degenerate
    soup.triangles.push_back({t[2], t[2], t[2]});
    soup.triangles.push_back({t[0], t[1], soundVertices + i % 3});      // not finite
    const auto mid = static_cast<std::uint32_t>(soup.vertices.size());  // T-junction, collinear
    soup.vertices.push_back(0.5F * (soup.vertices[t[0]] + soup.vertices[t[1]]));
    soup.triangles.push_back({t[0], mid, t[2]});
    soup.triangles.push_back({t[0], mid, t[1]});
    soup.vertices.push_back(soup.vertices[t[0]] + geometry::Vec3f(0, 1e-3F, -1e-3F));  // crossing, below
    soup.triangles.push_back({t[0], mid + 1, t[1]});
  }
  for (const auto faces : {scene::TouchableFaces::front, scene::TouchableFaces::both}) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    scene.faces = faces;
    add(soup, surface(1000, 0.3, 0.3));
    for (int i = 0; i < 60; ++i) {
      start({uniform(-0.9, 0.9) * kHalf, uniform(-0.9, 0.9) * kHalf, 0.002});
      to({hip().x(), hip().y(), -0.001}, 0.2);
      for (int k = 0; k < 3; ++k) {
        to({uniform(-0.9, 0.9) * kHalf, uniform(-0.9, 0.9) * kHalf, -0.001}, 0.2, [&](const Rendering& r) {
          EXPECT_TRUE(r.force_N.allFinite());
          EXPECT_TRUE(r.touching);
          EXPECT_GT(proxy().z(), -1e-9);
          EXPECT_NEAR(r.normalForce_N.z(), 1.0, 1e-3);
        });
      }
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture

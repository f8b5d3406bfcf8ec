// A scanned mesh, as it is and subdivided to a million triangles: a hand that slides over it 2 mm deep and
// taps.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>

#include "meshes.h"
#include "realtime/render/nearby.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

#ifdef HAPTICD_SANITIZED
constexpr int kTicks = 3'000;
constexpr int kSplits = 2;
#else
constexpr int kTicks = 30'000;
constexpr int kSplits = 4;
#endif

TriangleMesh readObj(const std::string& path) {
  TriangleMesh mesh;
  std::ifstream file(path);
  for (std::string line, word; std::getline(file, line);) {
    std::istringstream in(line);
    in >> word;
    if (word == "v") {
      auto& v = mesh.vertices.emplace_back();
      in >> v.x() >> v.y() >> v.z();
    } else if (word == "f") {
      auto& t = mesh.triangles.emplace_back();
      for (auto& i : t) i = in >> word ? static_cast<std::uint32_t>(std::stoul(word)) - 1 : 0;
    }
  }
  return mesh;
}

// Each triangle into four.
TriangleMesh split(const TriangleMesh& mesh) {
  TriangleMesh out{mesh.vertices, {}};
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const auto [it, fresh] =
        middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(out.vertices.size()));
    if (fresh) out.vertices.push_back(0.5F * (mesh.vertices[a] + mesh.vertices[b]));
    return it->second;
  };
  for (const auto& t : mesh.triangles) {
    const auto ab = middle(t[0], t[1]);
    const auto bc = middle(t[1], t[2]);
    const auto ca = middle(t[2], t[0]);
    out.triangles.insert(out.triangles.end(), {{t[0], ab, ca}, {ab, t[1], bc}, {ca, bc, t[2]}, {ab, bc, ca}});
  }
  return out;
}

TriangleMesh bunny(int splits) {
  TriangleMesh mesh = readObj(std::string(HAPTICD_TESTDATA) + "/meshes/bunny.obj");
  for (int i = 0; i < splits; ++i) mesh = split(mesh);
  const geometry::Box box = geometry::boundsOf(mesh);
  const double scale = 0.1 / box.extents().maxCoeff();
  geometry::scaleAndMove(mesh, scale, -scale * box.centre());
  return mesh;
}

// A hand that explores: it seeks the surface, slides over it 2 mm deep with a wandering direction, and taps.
class Explorer {
 public:
  Vec3 next(const Rendering& r) {
    if (lift_ > 0) {
      --lift_;
      hip_ += (lift_ > 50 ? 1e-4 : -1e-4) * hip_.normalized();
    } else if (r.touching) {
      direction_ = (direction_ + 0.02 * Vec3(gauss_(random_), gauss_(random_), gauss_(random_))).normalized();
      const double depth = (r.proxy_m - hip_).dot(r.normal);
      hip_ += 1e-4 * (direction_ - r.normal * r.normal.dot(direction_));
      hip_ -= std::clamp(0.05 * (0.002 - depth), -1e-4, 1e-4) * r.normal;
      if (random_() % 2000 == 0) lift_ = 100;
    } else if (hip_.norm() > 0.005) {
      hip_ -= 5e-5 * hip_.normalized();
    }
    return hip_;
  }

 private:
  Vec3 hip_{0.1, 0.02, 0.01};
  Vec3 direction_ = Vec3::UnitY();
  int lift_ = 0;
  std::mt19937 random_{1};
  std::normal_distribution<double> gauss_;
};

// How much nearer to the HIP a blind walk of small free steps gets from the proxy.
double reachable(Nearby& nearby, const scene::SceneSnapshot& scene, const Vec3& proxy, const Vec3& hip,
                 std::mt19937& random) {
  std::normal_distribution<double> gauss;
  nearby.begin({&scene, 0}, {});
  nearby.include(proxy, 1);
  nearby.gather(proxy, 3e-4);
  Vec3 p = proxy;
  for (int k = 0; k < 200; ++k) {
    const double size = std::pow(10, -5.0 - 0.002 * static_cast<double>(random() % 1000));
    const Vec3 q = p + size * Vec3(gauss(random), gauss(random), gauss(random));
    Hit hit;
    if ((q - proxy).norm() > 2.5e-4 || (q - hip).norm() >= (p - hip).norm()) continue;
    if (!nearby.cast(p, q, hit)) p = q;
  }
  return (proxy - hip).norm() - (p - hip).norm();
}

bool isInside(const scene::MeshGeometry& mesh, const Vec3& p) {
  const Vec3 d(1.0, 0.337, 0.211);
  std::vector<std::uint32_t> crossed;
  mesh.index.visitSegment(p, p + d, [&](std::uint32_t t) noexcept {
    const scene::Corners k = mesh.corners(t, 0);
    geometry::Mat3 m;
    m << k.b - k.a, k.c - k.a, -d;
    const Vec3 x = m.inverse() * (p - k.a);
    if (x.x() >= 0 && x.y() >= 0 && x.x() + x.y() <= 1 && x.z() > 0) crossed.push_back(t);
    return 1.0;
  });
  std::sort(crossed.begin(), crossed.end());
  return (std::unique(crossed.begin(), crossed.end()) - crossed.begin()) % 2 == 1;
}

class RealMeshTest : public testing::TestWithParam<std::tuple<int, double>> {};

TEST_P(RealMeshTest, exploring_hand_neither_tunnels_nor_sticks) {
  const auto [splits, mu] = GetParam();
  SceneFixture fixture;
  fixture.add(bunny(splits), surface(1000, mu, mu));
  const auto snapshot = fixture.snapshot();
  const scene::MeshGeometry& mesh = *snapshot->objects[0]->mesh;
  Hand hand(snapshot);
  Explorer explorer;
  Nearby nearby(0);
  std::mt19937 random(4);
  Vec3 lastForce = Vec3::Zero();
  Vec3 lastNormal = Vec3::Zero();
  Vec3 lastHip = explorer.next({});
  int touching = 0;
  for (int i = 0; i < kTicks; ++i) {
    const Vec3 hip = explorer.next(hand.now());
    const Rendering& r = hand.at(hip);
    ASSERT_EQ(r.status, 0U) << i;
    ASSERT_LE(r.force_N.norm(), 1000 * r.depth_m * std::sqrt(1 + mu * mu) * 1.01 + 1e-9) << i;
    touching += r.touching ? 1 : 0;
    // A thin part may let go of a hand that has come out on its other side, but of no other.
    const bool letGo = !r.touching && lastForce.norm() > 0;
    if (letGo || i % 10 == 0) {
      ASSERT_FALSE(isInside(mesh, r.proxy_m)) << i;
    }
    if (!letGo) {
      const double turn = lastNormal.norm() > 0 ? (r.normal - lastNormal).norm() : 0.0;  // 2 sin(phi / 2)
      const double depth = std::max(r.depth_m, lastForce.norm() / 1000);
      // With friction the lateral part turns into depth and depth into friction.
      const double bound = (1 + mu) * (1 + mu) * (1000 * (hip - lastHip).norm() + 1000 * depth * turn + 0.02);
      ASSERT_LE((r.force_N - lastForce).norm(), bound) << i;
    }
    if (mu == 0 && i % 10 == 0 && r.touching) {
      ASSERT_LT(reachable(nearby, *snapshot, r.proxy_m, hip, random), 10e-6) << i;
    }
    lastForce = r.force_N;
    lastNormal = r.normal;
    lastHip = hip;
  }
  EXPECT_GT(touching, kTicks / 3);
}

INSTANTIATE_TEST_SUITE_P(, RealMeshTest,
                         testing::Combine(testing::Values(0, kSplits), testing::Values(0.0, 0.5)),
                         [](const auto& test) {
                           return "splits_" + std::to_string(std::get<0>(test.param)) +
                                  (std::get<1>(test.param) > 0 ? "_friction" : "_frictionless");
                         });

}  // namespace
}  // namespace hapticd::realtime::fixture

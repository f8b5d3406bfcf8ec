// Scanned meshes, original and subdivided to a million triangles: a HIP slides over them 2 mm deep and taps.
// An oracle that shares no code with the renderer judges each tick.
//   HAPTICD_SCANS=DIRECTORY HAPTICD_TICKS=N bin/render_test --gtest_filter='RealMesh.*'
// judges all .obj files of a directory.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <numbers>
#include <optional>
#include <sstream>
#include <string>

#include "mesh_oracle.h"
#include "meshes.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

#ifdef HAPTICD_SANITIZED
constexpr int kTicks = 6'000;
constexpr int kSplits = 2;
#else
constexpr int kTicks = 15'000;
constexpr int kSplits = 4;
#endif
constexpr double kStiffness = 1000;
constexpr double kHop_m = 10e-6;  // minima that are shallower than the gap tolerance do not count

TriangleMesh readObj(const std::filesystem::path& path) {
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

// 100 mm long, around the origin.
TriangleMesh scan(const std::filesystem::path& path, int splits) {
  TriangleMesh mesh = readObj(path);
  for (int i = 0; i < splits; ++i) mesh = split(mesh);
  const geometry::Box box = geometry::boundsOf(mesh);
  const double scale = 0.1 / box.extents().maxCoeff();
  geometry::scaleAndMove(mesh, scale, -scale * box.centre());
  return mesh;
}

// A HIP that explores: it seeks the surface, slides over it 2 mm deep with a wandering direction, and taps.
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

// A HIP that ignores the surface: straight between places near the mesh, up to 8 mm deep.
class Wanderer {
 public:
  explicit Wanderer(const TriangleMesh& mesh) : mesh_(mesh) {}

  Vec3 next(const Rendering&) {
    if ((goal_ - hip_).norm() < 2e-4) {
      const auto any = static_cast<std::size_t>(random_()) % mesh_.vertices.size();
      const Vec3 place = mesh_.vertices[any].cast<double>();
      const bool far = random_() % 4 != 0 && (place - hip_).norm() > 0.02;
      if (far) return hip_;  // mostly to places nearby: try again in the next tick
      goal_ = place + 0.008 * std::uniform_real_distribution<double>(-1, 0.2)(random_) * place.normalized();
      speed_m_ = random_() % 2 == 0 ? 5e-5 : 2e-4;
    }
    hip_ += speed_m_ * (goal_ - hip_).normalized();
    return hip_;
  }

 private:
  const TriangleMesh& mesh_;
  Vec3 hip_{0.07, 0.05, 0.06};
  Vec3 goal_ = hip_;
  double speed_m_ = 0;
  std::mt19937 random_{7};
};

struct Verdict {
  int touching = 0;
  int tunnelled = 0;
  int aroundBorder = 0;  // of an open mesh
  int checked = 0;
  int stuck = 0;
  double worst_m = 0;
  int unfinished = 0;  // ended by the tick's budget
  int tooStrong = 0;
  int overStep = 0;     // more than one edge allows
  int unexplained = 0;  // of these, where the tool could have stayed near
};

std::ostream& operator<<(std::ostream& out, const Verdict& v) {
  return out << "touching " << v.touching << ", tunnelled " << v.tunnelled << " (around a border "
             << v.aroundBorder << "), stuck " << v.stuck << " of " << v.checked << " (worst "
             << v.worst_m * 1e6 << " um), unfinished " << v.unfinished << ", too strong " << v.tooStrong
             << ", over the step of one edge " << v.overStep << ", of these unexplained " << v.unexplained;
}

class Judge {
 public:
  Judge(const TriangleMesh& mesh, double mu, double radius_m)
      : mesh_(mesh), radius_m_(radius_m), oracle_(mesh, radius_m), mu_(mu) {}

  void see(const Vec3& hip, const Rendering& r, bool check) {
    const bool finished = (r.status & (kRenderIterationLimit | kRenderWorkLimit)) == 0;
    if (!finished) ++verdict.unfinished;
    // Normal force by depth, and with friction by the spring to the proxy: between walls, friction is not
    // bounded by the resultant.
    if (r.normalForce_N.norm() > kStiffness * r.depth_m * 1.01 + 1e-9 ||
        r.force_N.norm() > kStiffness * (hip - r.proxy_m).norm() * 1.01 + 1e-9) {
      ++verdict.tooStrong;
    }
    if (r.touching) ++verdict.touching;
    if (started_) judgeWay(r);
    if (started_ && mu_ == 0) judgeStep(hip, r);
    if (mu_ == 0 && check && finished && r.touching) judgeRest(hip, r);
    started_ = true;
    hip_ = hip;
    last_ = r;
  }

  void startAnew() { started_ = false; }

  Verdict verdict;

 private:
  void judgeWay(const Rendering& r) {
    if (oracle_.entered(last_.proxy_m, r.proxy_m) <= 0) return;
    ++(oracle_.borderNear(last_.proxy_m, r.proxy_m) ? verdict.aroundBorder : verdict.tunnelled);
  }

  // An edge turns the force by its angle, at once. More is right only where the tool cannot rest nearer.
  void judgeStep(const Vec3& hip, const Rendering& r) {
    const double step = (r.force_N - last_.force_N).norm();
    const double moved = kStiffness * (hip - hip_).norm();
    if (step <= moved + 0.02) return;
    const double depth = std::max(r.depth_m, last_.depth_m);
    const double edge = std::min(oracle_.sharpestEdge(last_.proxy_m, r.proxy_m), std::numbers::pi / 2);
    const double allowed = kStiffness * depth * std::sin(edge) + 0.02;
    if (step <= moved + allowed) return;
    ++verdict.overStep;
    if (radius_m_ > 0) return;  // the oracle needs minutes to explain a ball
    const Vec3 rest = oracle_.descend(last_.proxy_m, hip, 0.05, kHop_m);
    if (kStiffness * (rest - last_.proxy_m).norm() <= allowed) ++verdict.unexplained;
  }

  void judgeRest(const Vec3& hip, const Rendering& r) {
    ++verdict.checked;
    const Vec3 rest = oracle_.descend(r.proxy_m, hip, 3e-4);
    const double gain = (r.proxy_m - hip).norm() - (rest - hip).norm();
    verdict.worst_m = std::max(verdict.worst_m, gain);
    if (gain > 10e-6 && !heldWithinTolerance(hip, r)) ++verdict.stuck;
  }

  // The point tool is a ball of 5 um where surfaces meet, so it may rest in a hollow that a true point slips
  // through. Such a hollow holds a ball of that radius in the oracle, too.
  bool heldWithinTolerance(const Vec3& hip, const Rendering& r) {
    if (radius_m_ > 0) return false;
    if (!tolerant_) tolerant_.emplace(mesh_, 5e-6);
    const Vec3 rest = tolerant_->descend(r.proxy_m, hip, 3e-4);
    return (r.proxy_m - hip).norm() - (rest - hip).norm() <= 10e-6;
  }

  const TriangleMesh& mesh_;
  double radius_m_;
  MeshOracle oracle_;
  std::optional<MeshOracle> tolerant_;
  double mu_;
  bool started_ = false;
  Vec3 hip_ = Vec3::Zero();
  Rendering last_;
};

Verdict explore(const TriangleMesh& mesh, double mu, double radius_m, int ticks, int checkEvery) {
  SceneFixture fixture;
  fixture.add(mesh, surface(kStiffness, mu, 0.6 * mu));
  RenderOptions options;
  options.toolRadius_m = radius_m;
  Hand hand(fixture.snapshot(), options);
  Judge judge(mesh, mu, radius_m);
  Explorer explorer;
  Wanderer wanderer(mesh);
  for (int i = 0; i < ticks; ++i) {
    const Vec3 hip = i < ticks / 2 ? explorer.next(hand.now()) : wanderer.next(hand.now());
    if (i == ticks / 2) {
      hand.renderer().reset();
      judge.startAnew();
    }
    judge.see(hip, hand.at(hip), i % checkEvery == 0);
  }
  return judge.verdict;
}

// A ball converges on edges and corners, and now and then not within a tick; where it goes then is not only
// the shape's choice.
void expectRight(const Verdict& v, double radius_m) {
  EXPECT_EQ(v.tunnelled, 0);
  EXPECT_EQ(v.stuck, 0);
  EXPECT_EQ(v.tooStrong, 0);
  // A point that slips over thousands of small cells at once goes on in the next tick.
  EXPECT_LE(v.unfinished, v.touching / (radius_m > 0 ? 200 : 1000));
  if (radius_m == 0) {
    EXPECT_EQ(v.unexplained, 0);
  }
}

struct Case {
  const char* name;
  int splits;
  double mu;
  double radius_m;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name << " split " << c.splits << ", friction " << c.mu << ", radius " << c.radius_m << " m";
}

class RealMeshTest : public testing::TestWithParam<Case> {};

TEST_P(RealMeshTest, exploring_hand_neither_tunnels_nor_sticks) {
  const Case& c = GetParam();
  const auto path = std::filesystem::path(HAPTICD_TESTDATA) / "meshes" / (std::string(c.name) + ".obj");
  const int ticks = kTicks;
  const Verdict v = explore(scan(path, c.splits), c.mu, c.radius_m, ticks, c.radius_m > 0 ? 25 : 5);
  std::cout << v << '\n';
  EXPECT_GT(v.touching, ticks / 40);
  expectRight(v, c.radius_m);
}

INSTANTIATE_TEST_SUITE_P(, RealMeshTest,
                         testing::Values(Case{"bunny", 0, 0, 0}, Case{"bunny", 0, 0.5, 0},
                                         Case{"bunny", kSplits, 0, 0}, Case{"bunny", kSplits, 0.5, 0},
                                         Case{"bunny", 0, 0, 0.001}, Case{"bunny", 0, 0.5, 0.001},
                                         Case{"teapot", 0, 0, 0}, Case{"teapot", 0, 0.5, 0},
                                         Case{"teapot", 0, 0, 0.001}),
                         [](const auto& test) {
                           const Case& c = test.param;
                           return std::string(c.name) + "_" + std::to_string(c.splits) +
                                  (c.mu > 0 ? "_friction" : "_frictionless") +
                                  (c.radius_m > 0 ? "_ball" : "_point");
                         });

// Meshes for which nothing was tuned.
TEST(RealMesh, scans_of_a_directory) {
  const char* directory = std::getenv("HAPTICD_SCANS");
  if (directory == nullptr) GTEST_SKIP() << "no HAPTICD_SCANS";
  const char* ticksText = std::getenv("HAPTICD_TICKS");
  const int ticks = ticksText != nullptr ? std::atoi(ticksText) : kTicks;
  for (const auto& file : std::filesystem::directory_iterator(directory)) {
    if (file.path().extension() != ".obj") continue;
    const TriangleMesh mesh = scan(file.path(), 0);
    for (const double radius_m : {0.0, 0.001}) {
      for (const double mu : {0.0, 0.5}) {
        const Verdict v = explore(mesh, mu, radius_m, ticks, 1);
        SCOPED_TRACE(file.path().filename());
        std::cout << file.path().filename().string() << ", radius " << radius_m << " m, friction " << mu
                  << ": " << v << std::endl;
        expectRight(v, radius_m);
      }
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture

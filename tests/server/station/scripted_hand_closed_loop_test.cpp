// The scripted hand in closed loop with the renderer: it presses gently and follows the surface on every
// mesh.
//   HAPTICD_EXPLORE=FILE:FILE bin/server_scripted_hand_test
// measures other meshes as well, for example large scans.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <set>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "base/time.h"
#include "device/simulated/simulated_device.h"
#include "mesh_io/mesh_io.h"
#include "realtime/servo/fakes.h"
#include "realtime/servo/tick.h"
#include "reduced.h"
#include "scene/builder.h"
#include "server/station/scripted_hand.h"

namespace hapticd::server {
namespace {

using base::Nanos;
using geometry::TriangleMesh;
using geometry::Vec3;

constexpr int kTurns = reduced(3);

// As `hapticd touch` sends it: at most 80 % of the workspace and 100 mm, centred.
void fitIntoWorkspace(TriangleMesh& mesh) {
  const geometry::Box bounds = geometry::boundsOf(mesh);
  const Vec3 extents = bounds.extents().cwiseMax(1e-12);
  const double scale =
      std::min((0.8 * Eigen::Array3d(160, 120, 70) / extents.array()).minCoeff(), 100 / extents.maxCoeff());
  geometry::scaleAndMove(mesh, scale, -scale * bounds.centre());
}

std::shared_ptr<const scene::SceneSnapshot> sceneOf(TriangleMesh mesh, double stiffness) {
  fitIntoWorkspace(mesh);
  scene::SceneBuilder builder;
  std::vector<scene::Notice> notices;
  builder.apply(1, scene::BeginBatch{}, 0, notices);
  builder.apply(1, scene::SetVertices{0, 0, mesh.vertices}, 0, notices);
  builder.apply(1, scene::SetTriangles{0, 0, mesh.triangles, false}, 0, notices);
  builder.apply(1, scene::SetSurfaceProperty{0, "stiffness", stiffness}, 0, notices);
  builder.apply(1, scene::SetSurfaceProperty{0, "static_friction", 0.3}, 0, notices);
  builder.apply(1, scene::SetSurfaceProperty{0, "dynamic_friction", 0.2}, 0, notices);
  builder.apply(1, scene::CommitBatch{}, 0, notices);
  return builder.publish(0, notices);
}

TriangleMesh cube() {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices.emplace_back((i & 1) ? 1 : -1, (i & 2) ? 1 : -1, (i & 4) ? 1 : -1);
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

// An open sheet: both sides can be touched, and nothing is inside.
TriangleMesh sheet() {
  TriangleMesh mesh;
  mesh.vertices = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

// A plate of 1 mm and 100 mm: thinner than a press is deep.
TriangleMesh plate() {
  TriangleMesh mesh = cube();
  for (auto& vertex : mesh.vertices) vertex.y() *= 0.01F;
  return mesh;
}

// A cup: a cube without its lid, with an inside that can be reached only from above.
TriangleMesh cup() {
  TriangleMesh mesh = cube();
  mesh.triangles.erase(mesh.triangles.begin() + 6, mesh.triangles.begin() + 8);
  return mesh;
}

struct Exploration {
  int ticks = 0;
  int contact = 0;
  int atLimit = 0;
  int deep = 0;
  int hard = 0;      // above what a curious person presses
  int heldBack = 0;  // the hand is far from where the path wants it: the path went on behind something
  double deepest_m = 0;
  double slid_m = 0;
  std::set<std::tuple<int, int, int>> places;  // visited cells of 5 mm
  double planned_s = 0;

  double part(int count) const { return contact > 0 ? static_cast<double>(count) / contact : 0; }
};

// For one round of the path.
Exploration explore(const TriangleMesh& mesh) {
  const auto scene = sceneOf(mesh, 0.8);
  device::SimulatedDevice hand;
  hand.open();
  const auto path = planStrokes(*scene, hand.profile().workspace_m, 0);
  const auto wanted =
      std::make_shared<device::WaypointPath>(path, device::WaypointPath::Repeat::yes, kScriptedStrength_N);
  hand.setPath(wanted);
  realtime::FakeClock clock;
  realtime::TickOptions options;
  options.guard = realtime::GuardOptions::of(hand.profile());
  options.guard.selfRecover = true;
  realtime::Tick tick(hand, clock, options);
  tick.snapshots().publish(scene);

  Exploration seen;
  seen.planned_s = path.back().time_s;
  const double limit_N = 0.99 * hand.profile().peakForce_N;
  Vec3 before = Vec3::Zero();
  bool wasTouching = false;
  for (Nanos now = 0; now < wanted->duration(); now += 1'000'000) {
    tick(now);
    tick.reports().consume([](const realtime::TickReport&) {});
    const realtime::TickReport& report = tick.last();
    ++seen.ticks;
    seen.heldBack += (wanted->at(now).position_m - report.device.position_m).norm() > 0.008 ? 1 : 0;
    const Vec3 point = report.rendering.scp_m;
    if (report.rendering.touching) {
      ++seen.contact;
      seen.atLimit += report.force_N.norm() >= limit_N ? 1 : 0;
      seen.hard += report.force_N.norm() > 2 ? 1 : 0;
      seen.deep += report.rendering.depth_m > 0.006 ? 1 : 0;
      seen.deepest_m = std::max(seen.deepest_m, report.rendering.depth_m);
      if (wasTouching) seen.slid_m += (point - before).norm();
      const Eigen::Vector3i cell = (point / 0.005).array().floor().cast<int>();
      seen.places.emplace(cell.x(), cell.y(), cell.z());
    }
    wasTouching = report.rendering.touching;
    before = point;
  }
  tick.finish();
  return seen;
}

void print(const std::string& name, const Exploration& seen) {
  std::cout << name << ": path " << seen.planned_s << " s; in contact " << 100.0 * seen.contact / seen.ticks
            << " % of the time, slid " << seen.slid_m << " m over " << seen.places.size()
            << " cells of 5 mm; at the limit " << 100 * seen.part(seen.atLimit)
            << " % of the contact, above 2 N " << 100 * seen.part(seen.hard) << " %, deeper than 6 mm "
            << 100 * seen.part(seen.deep) << " %, deepest " << 1e3 * seen.deepest_m << " mm; held back "
            << 100.0 * seen.heldBack / seen.ticks << " % of the time\n";
}

TriangleMesh shape(const std::string& name) {
  if (name == "cube") return cube();
  if (name == "sheet") return sheet();
  if (name == "plate") return plate();
  return name == "cup" ? cup() : mesh_io::loadMesh(name);
}

std::vector<std::string> shapes() {
  std::vector<std::string> names{"sheet", HAPTICD_TESTDATA "/meshes/bunny.obj", "cube", "plate",
                                 "cup",   HAPTICD_TESTDATA "/meshes/teapot.obj"};
  // Under a sanitizer: an open sheet and a closed scan.
  names.resize(static_cast<std::size_t>(reduced(6, 2)));
  const char* files = std::getenv("HAPTICD_EXPLORE");
  std::stringstream list(files == nullptr ? "" : files);
  for (std::string file; std::getline(list, file, ':');) names.push_back(file);
  return names;
}

class ScriptedHandClosedLoop : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, ScriptedHandClosedLoop, testing::ValuesIn(shapes()), [](const auto& test) {
  return std::to_string(test.index) + "_" + std::filesystem::path(test.param).stem().string();
});

// Turned, a shape meets other strokes, in another size.
TriangleMesh turned(TriangleMesh mesh, int turn) {
  const Eigen::Quaternionf by =
      turn == 0 ? Eigen::Quaternionf::Identity()
                : Eigen::Quaternionf(1, std::sin(2.3F * turn), std::sin(1.7F * turn), std::sin(3.1F * turn))
                      .normalized();
  for (auto& vertex : mesh.vertices) vertex = by * vertex;
  return mesh;
}

TEST_P(ScriptedHandClosedLoop, follows_the_surface_below_the_limit_of_the_force) {
  const TriangleMesh mesh = shape(GetParam());
  for (int turn = 0; turn < kTurns; ++turn) {
    SCOPED_TRACE("turn " + std::to_string(turn));
    const Exploration seen = explore(turned(mesh, turn));
    print(GetParam(), seen);
    EXPECT_EQ(seen.atLimit, 0);
    EXPECT_LT(seen.part(seen.hard), 0.01);
    EXPECT_LT(seen.part(seen.deep), 0.01);
    EXPECT_LT(seen.deepest_m, 0.006);
    EXPECT_LT(seen.heldBack, seen.ticks / 100);
    EXPECT_GT(seen.contact, seen.ticks / 5);
    EXPECT_GT(seen.slid_m, 0.2);
    EXPECT_GT(seen.places.size(), 40U);
  }
}

}  // namespace
}  // namespace hapticd::server

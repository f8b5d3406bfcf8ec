// What a server holds with a mesh of a million triangles that is touched.
#include <malloc.h>

#include <chrono>
#include <fstream>
#include <string>
#include <thread>

#include "bench/all.h"
#include "bench/scenes.h"
#include "bench/server_process.h"
#include "bench/tick_watcher.h"
#include "hapticd/client.h"
#include "scene/spatial_index.h"

namespace hapticd::bench {
namespace {

using namespace std::chrono_literals;

double ownResidentBytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) return 1024 * std::stod(line.substr(6));
  }
  return 0;
}

// By what this process grows when it builds one.
double indexBytes(const geometry::TriangleMesh& mesh) {
  malloc_trim(0);
  const double before = ownResidentBytes();
  const auto index =
      scene::SpatialIndex::build(static_cast<std::uint32_t>(mesh.triangles.size()), [&](std::uint32_t id) {
        geometry::Box box;
        for (const std::uint32_t v : mesh.triangles[id]) box.extend(Vec3(mesh.vertices[v].cast<double>()));
        return box;
      });
  malloc_trim(0);
  return ownResidentBytes() - before;
}

void waitForTouch(TickWatcher& watcher) {
  for (int i = 0; i < 400; ++i) {
    std::this_thread::sleep_for(50ms);
    if (watcher.take().touching) return;
  }
  throw std::runtime_error("the mesh was not touched within 20 s");
}

}  // namespace

Outcome measureMemory(const Run& run) {
  const geometry::TriangleMesh& mesh = bumpyBall(1'000'000);
  run.progress("the index alone");
  const double vertices = static_cast<double>(mesh.vertices.size() * sizeof(Vec3f));
  const double triangles = static_cast<double>(mesh.triangles.size() * sizeof(geometry::Triangle));
  const double index = indexBytes(mesh);
  run.progress("a server with a mesh of a million triangles");
  const ServerProcess server(handFile(10, static_cast<int>(Act::tap)));
  const double empty = server.residentBytes();
  Client client(server.device());
  client.setSurfaceProperty(0, "stiffness", 0.5F);
  std::vector<std::array<float, 3>> corners;
  for (const Vec3f& v : mesh.vertices) corners.push_back({v.x(), v.y(), v.z()});
  client.uploadMesh(0, {corners, mesh.triangles});
  TickWatcher watcher(server.device());
  waitForTouch(watcher);
  client.runFor(1500ms);  // what the upload needed is freed by then

  constexpr double kMega = 1e-6;
  Outcome outcome;
  Row row{"resident memory of the server",
          "MB",
          Summary::of(server.residentBytes() * kMega),
          Summary::of((vertices + triangles + index) * kMega),
          {},
          {}};
  row.checks.push_back({"ratio", row.ratio(), 2.5});
  outcome.rows = {
      row,
      {"- of an empty server", "MB", Summary::of(empty * kMega), std::nullopt, {}, {}},
      {"- vertices and triangles", "MB", Summary::of((vertices + triangles) * kMega), std::nullopt, {}, {}},
      {"- the index", "MB", Summary::of(index * kMega), std::nullopt, {}, {}}};
  return outcome;
}

}  // namespace hapticd::bench

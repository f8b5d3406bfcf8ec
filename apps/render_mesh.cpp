// A recorded hand through a mesh: one row of CSV for each tick, and figures for people.
#include "base/time.h"
#include "render_mesh.h"

#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <vector>

#include "device/profiles.h"
#include "device/simulated/hand_file.h"
#include "mesh_io/mesh_io.h"
#include "realtime/render/renderer.h"
#include "realtime/servo/guard.h"
#include "scene/builder.h"

namespace hapticd::apps {
namespace {

using base::Nanos;
using geometry::Vec3;

constexpr Nanos kPeriod = 1'000'000;

double seconds(std::chrono::steady_clock::duration d) {
  return std::chrono::duration<double>(d).count();
}

// The scene through the same commands that a client sends; stock units: stiffness 1 is 1000 N/m.
std::shared_ptr<const scene::SceneSnapshot> makeScene(const MeshRenderOptions& options, geometry::TriangleMesh&& mesh) {
  scene::SceneConfig config;
  config.raw = options.raw;
  scene::SceneBuilder builder(config);
  std::vector<scene::Notice> notices;
  const auto say = [&](scene::SceneCommand&& command) { builder.apply(1, std::move(command), 0, notices); };

  const double scale = options.meshUnit == "m" ? 1.0 : 1e-3;
  say(scene::BeginBatch{});
  say(scene::SetVertices{0, 0, std::move(mesh.vertices)});
  say(scene::SetTriangles{0, 0, std::move(mesh.triangles)});
  say(scene::SetTransform{0, {scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, 1}});
  say(scene::SetSurface{.object = 0,
                        .stiffness = options.stiffness_N_per_m / 1000,
                        .damping = options.damping_Ns_per_m / 1000,
                        .staticFriction = options.staticFriction,
                        .dynamicFriction = options.dynamicFriction});
  say(scene::SetTouchableFaces{options.faces == "front" ? 0 : options.faces == "back" ? 1 : 2});
  say(scene::CommitBatch{});
  auto snapshot = builder.publish(0, notices);
  for (const scene::Notice& notice : notices) {
    std::fprintf(stderr, "scene: %s\n", notice.text.c_str());
    if (notice.severity == scene::Notice::Severity::error)
      throw std::runtime_error("the mesh cannot be rendered");
  }
  return snapshot;
}

// One line of CSV; numbers in the shortest form that reads back as the same double.
class Row {
 public:
  void add(double value) {
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value == 0 ? 0.0 : value).ptr;
    addText({text, static_cast<std::size_t>(end - text)});
  }
  void add(const Vec3& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  }
  void add(int value) { addText(std::to_string(value)); }
  void writeTo(std::ofstream& out) {
    line_ += '\n';
    out << line_;
    line_.clear();
  }

 private:
  void addText(std::string_view text) {
    if (!line_.empty()) line_ += ',';
    line_ += text;
  }
  std::string line_;
};

struct Felt {
  std::vector<double> step_us;
  double peakForce_N = 0;
  double deepest_m = 0;
  std::size_t touching = 0;
};

Felt follow(const MeshRenderOptions& options, const device::HandFile& hand, const scene::SceneSnapshot& snapshot,
            std::ofstream& out) {
  realtime::Renderer renderer({.toolRadius_m = options.toolRadius_mm * 1e-3, .forceShading = false});
  realtime::GuardOptions guardOptions = realtime::GuardOptions::of(device::profiles().front());
  guardOptions.enabled = !options.raw;
  guardOptions.selfRecover = true;
  const realtime::GuardControl control(guardOptions.armed);
  realtime::Guard guard(guardOptions, control, kPeriod);

  Felt felt;
  Row row;
  realtime::Rendering rendering;
  const Nanos last = hand.duration();
  for (Nanos t = hand.begin(); t <= last; t += kPeriod) {
    const device::HandPose pose = hand.at(t);
    device::DeviceState state;
    state.time = t;
    state.position_m = pose.position_m;
    state.velocity_m_per_s = pose.velocity_m_per_s;
    state.orientation = pose.orientation;
    state.buttons = pose.buttons;

    const auto before = std::chrono::steady_clock::now();
    renderer.step(snapshot, state, t, kPeriod, rendering);
    const double step_us = seconds(std::chrono::steady_clock::now() - before) * 1e6;
    const Vec3 force_N = guard.step({.force_N = rendering.force_N,
                                     .state = &state,
                                     .period = kPeriod,
                                     .late = 0,
                                     .writeFailed = false,
                                     .geometryJump = (rendering.status & realtime::kRenderGeometryJump) != 0,
                                     .deepContact = (rendering.status & realtime::kRenderReleased) != 0});

    row.add(base::toSeconds(t));
    row.add(pose.position_m);
    row.add(rendering.proxy_m);
    row.add(force_N);
    row.add(rendering.touching ? rendering.depth_m : 0.0);
    row.add(rendering.touching ? 1 : 0);
    row.add(rendering.touching ? static_cast<int>(rendering.touchedObject) : -1);
    row.add(rendering.touching ? rendering.normal : Vec3(Vec3::Zero()));
    if (options.timing) row.add(step_us);
    row.writeTo(out);

    felt.step_us.push_back(step_us);
    felt.peakForce_N = std::max(felt.peakForce_N, force_N.norm());
    felt.deepest_m = std::max(felt.deepest_m, rendering.touching ? rendering.depth_m : 0.0);
    felt.touching += rendering.touching ? 1 : 0;
  }
  return felt;
}

// Centred, and as large as asked for.
void fit(geometry::TriangleMesh& mesh, const MeshRenderOptions& options) {
  const geometry::Box bounds = geometry::boundsOf(mesh);
  if (bounds.empty() || bounds.extents().maxCoeff() <= 0)
    throw std::runtime_error("the mesh has no extent to scale");
  const double unitsPerMm = options.meshUnit == "m" ? 1e-3 : 1.0;
  const double scale = options.size_mm * unitsPerMm / bounds.extents().maxCoeff();
  geometry::scaleAndMove(mesh, scale, -scale * bounds.centre());
}

double quantile(std::vector<double>& values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace

int renderMesh(const MeshRenderOptions& options) {
  const auto hand = device::HandFile::load(options.hand);
  geometry::TriangleMesh mesh = mesh_io::loadMesh(options.mesh);
  const std::size_t triangles = mesh.triangles.size();
  if (options.size_mm > 0) fit(mesh, options);

  const auto before = std::chrono::steady_clock::now();
  const auto snapshot = makeScene(options, std::move(mesh));
  const double build_s = seconds(std::chrono::steady_clock::now() - before);

  std::ofstream out(options.out);
  if (!out) throw std::runtime_error("cannot write '" + options.out + "'");
  out << "t_s,hip_x_m,hip_y_m,hip_z_m,proxy_x_m,proxy_y_m,proxy_z_m,force_x_N,force_y_N,force_z_N,depth_m,"
         "touching,"
         "object,normal_x,normal_y,normal_z"
      << (options.timing ? ",step_us\n" : "\n");
  Felt felt = follow(options, *hand, *snapshot, out);
  out.close();
  if (!out) throw std::runtime_error("writing '" + options.out + "' failed: disk full?");

  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("mesh        %zu triangles, scene and index built in %.3f s\n", triangles, build_s);
  std::printf("hand        %zu ticks of 1 ms, %zu touching\n", felt.step_us.size(), felt.touching);
  std::printf("felt        peak force %.3f N, deepest %.3f mm%s\n", felt.peakForce_N, felt.deepest_m * 1e3,
              options.raw ? " (raw: without the guard)" : "");
  std::printf("step time   p50 %.2f us, p99 %.2f us, max %.2f us\n", quantile(felt.step_us, 0.5),
              quantile(felt.step_us, 0.99), quantile(felt.step_us, 1.0));
  std::printf("peak memory %.1f MiB\n", static_cast<double>(usage.ru_maxrss) / 1024);
  return 0;
}

}  // namespace hapticd::apps

// Renders a mesh along a recorded hand: one row of CSV for each tick, and figures for people.
#include "render_mesh.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/world.h"
#include "compare_trajectory.h"
#include "device/profiles.h"
#include "device/simulated/hand_file.h"
#include "mesh_io/mesh_io.h"
#include "realtime/render/renderer.h"
#include "realtime/servo/guard.h"
#include "record/export.h"
#include "scene/builder.h"
#include "stop_signals.h"

namespace hapticd::apps {
namespace {

using base::Nanos;

constexpr Nanos kPeriod = 1'000'000;

// The scene through the same commands that a client sends; stock units: stiffness 1 is 1000 N/m.
std::shared_ptr<const scene::SceneSnapshot> makeScene(const MeshRenderOptions& options,
                                                      geometry::TriangleMesh&& mesh) {
  scene::SceneConfig config;
  config.raw = options.raw;
  config.ballTool = options.toolRadius_mm > 0;
  scene::SceneBuilder builder(config);
  std::vector<scene::Notice> notices;
  const auto apply = [&](scene::SceneCommand&& command) { builder.apply(1, std::move(command), 0, notices); };

  const double scale = options.meshUnit == "m" ? 1.0 : 1e-3;
  apply(scene::BeginBatch{});
  apply(scene::SetVertices{0, 0, std::move(mesh.vertices)});
  apply(scene::SetTriangles{0, 0, std::move(mesh.triangles)});
  apply(scene::SetTransform{0, {scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, 1}});
  apply(scene::SetSurface{.object = 0,
                          .stiffness = options.stiffness_N_per_m / 1000,
                          .damping = options.damping_Ns_per_m / 1000,
                          .staticFriction = options.staticFriction,
                          .dynamicFriction = options.dynamicFriction});
  apply(scene::SetTouchableFaces{options.faces == "front" ? 0 : options.faces == "back" ? 1 : 2});
  apply(scene::CommitBatch{});
  auto snapshot = builder.publish(0, notices);
  for (const scene::Notice& notice : notices) {
    std::fprintf(stderr, "scene: %s\n", notice.text.c_str());
    if (notice.severity == scene::Notice::Severity::error)
      throw std::runtime_error("the mesh cannot be rendered");
  }
  return snapshot;
}

struct Summary {
  std::vector<double> step_us;
  double peakForce_N = 0;
  double deepest_m = 0;
  std::size_t touching = 0;
  geometry::Box hips_m;
  std::vector<record::ForceSample> forces;  ///< only with --compare
};

Summary follow(const MeshRenderOptions& options, const device::HandFile& hand,
               const scene::SceneSnapshot& snapshot, record::CsvFile& out) {
  realtime::Renderer renderer({.toolRadius_m = options.toolRadius_mm * 1e-3, .forceShading = false});
  realtime::GuardOptions guardOptions = realtime::GuardOptions::of(device::profiles().front());
  guardOptions.enabled = !options.raw;
  guardOptions.selfRecover = true;
  const realtime::GuardControl control(guardOptions.armed);
  realtime::Guard guard(guardOptions, control, kPeriod);

  Summary summary;
  realtime::Rendering rendering;
  const Nanos last = hand.duration();
  for (Nanos t = hand.begin(); t <= last; t += kPeriod) {
    throwIfStopped();
    const device::HandPose pose = hand.at(t);
    device::DeviceState state;
    state.time = t;
    state.position_m = pose.position_m;
    state.velocity_m_per_s = pose.velocity_m_per_s;
    state.orientation = pose.orientation;
    state.buttons = pose.buttons;

    const Nanos before = base::now();
    renderer.step(snapshot, state, t, kPeriod, rendering);
    const Nanos step_ns = base::now() - before;
    const geometry::Vec3 force_N = guard.step(
        {.force_N = rendering.force_N,
         .state = &state,
         .period = kPeriod,
         .late = 0,
         .writeFailed = false,
         .geometryJump = (rendering.status & realtime::kRenderGeometryJump) != 0,
         .deepContact = (rendering.status & (realtime::kRenderReleased | realtime::kRenderEnclosed)) != 0});

    realtime::TickReport tick;
    tick.tick = summary.step_us.size() + 1;
    tick.time = t;
    tick.revision = snapshot.revision;
    tick.device = state;
    tick.rendering = rendering;
    tick.force_N = force_N;
    tick.guard = guard.report();
    record::Sample sample = record::sampleOf("mesh", tick, 0);
    sample.wakeupError_ns.reset();
    sample.compute_ns.reset();
    if (options.timing) sample.compute_ns = step_ns;
    out.add(sample);

    summary.step_us.push_back(static_cast<double>(step_ns) * 1e-3);
    summary.peakForce_N = std::max(summary.peakForce_N, force_N.norm());
    summary.deepest_m = std::max(summary.deepest_m, rendering.touching ? rendering.depth_m : 0.0);
    summary.touching += rendering.touching ? 1 : 0;
    summary.hips_m.extend(pose.position_m);
    if (!options.compare.empty())
      summary.forces.push_back({t, force_N, rendering.proxy_m, rendering.touching});
  }
  return summary;
}

// Centres the mesh and scales it to --size-mm.
void fit(geometry::TriangleMesh& mesh, const MeshRenderOptions& options) {
  const geometry::Box bounds = geometry::boundsOf(mesh);
  if (bounds.empty() || bounds.extents().maxCoeff() <= 0)
    throw std::runtime_error("the mesh has no extent to scale");
  const double unitsPerMm = options.meshUnit == "m" ? 1e-3 : 1.0;
  const double scale = options.size_mm * unitsPerMm / bounds.extents().maxCoeff();
  geometry::scaleAndMove(mesh, scale, -scale * bounds.centre());
}

std::string millimetres(const geometry::Box& box_m) {
  std::array<char, 160> text{};
  const geometry::Vec3 min = 1e3 * box_m.min;
  const geometry::Vec3 max = 1e3 * box_m.max;
  std::snprintf(text.data(), text.size(), "x %.4g to %.4g, y %.4g to %.4g, z %.4g to %.4g mm", min.x(),
                max.x(), min.y(), max.y(), min.z(), max.z());
  return text.data();
}

double quantile(std::vector<double>& values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace

int renderMesh(const MeshRenderOptions& options) {
  const auto hand = device::HandFile::load(options.hand, options.trajectory);
  if (!hand->remark().empty())
    std::fprintf(stderr, "hapticd: %s: %s\n", options.hand.c_str(), hand->remark().c_str());
  std::vector<record::ForceSample> reference;
  if (!options.compare.empty())
    reference = loadReference(options.compare, options.trajectory, hand->origin());
  geometry::TriangleMesh mesh = mesh_io::loadMesh(options.mesh);
  const std::size_t triangles = mesh.triangles.size();
  if (options.size_mm > 0) fit(mesh, options);
  geometry::Box bounds_m = geometry::boundsOf(mesh);
  const double metres = options.meshUnit == "m" ? 1.0 : 1e-3;
  bounds_m.min *= metres;
  bounds_m.max *= metres;

  const Nanos before = base::now();
  const auto snapshot = makeScene(options, std::move(mesh));
  const double build_s = base::toSeconds(base::now() - before);

  record::CsvFile out(options.out, record::Unfinished::dropped);
  const StopSignals signals;
  Summary summary = follow(options, *hand, *snapshot, out);
  out.close();
  if (summary.touching == 0) {
    std::fprintf(stderr, "hapticd: the hand never touched the mesh: the hand is at %s; the mesh at %s. %s\n",
                 millimetres(summary.hips_m).c_str(), millimetres(bounds_m).c_str(),
                 device::Trajectory::isNameOf(options.hand) ? "--mesh-unit and --traj-unit set the units"
                                                            : "--size-mm scales and centres the mesh");
  }

  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("mesh        %zu triangles, scene and index built in %.3f s\n", triangles, build_s);
  std::printf("hand        %zu ticks of 1 ms, %zu touching\n", summary.step_us.size(), summary.touching);
  std::printf("felt        peak force %.3f N, deepest %.3f mm%s\n", summary.peakForce_N,
              summary.deepest_m * 1e3, options.raw ? " (raw: without the guard)" : "");
  std::printf("step time   p50 %.2f us, p99 %.2f us, max %.2f us\n", quantile(summary.step_us, 0.5),
              quantile(summary.step_us, 0.99), quantile(summary.step_us, 1.0));
  std::printf("peak memory %.1f MiB\n", static_cast<double>(usage.ru_maxrss) / 1024);
  if (!options.compare.empty()) printComparison(options.compare, summary.forces, reference);
  return 0;
}

}  // namespace hapticd::apps

// The processor time of a tick among as many triangles as a scene may have, all where the hand is.
#include <time.h>

#include <random>
#include <thread>

#include "base/clock.h"
#include "bench/all.h"
#include "bench/scenes.h"
#include "bench/timing.h"
#include "realtime/render/renderer.h"

namespace hapticd::bench {
namespace {

constexpr double kHalf_mm = 80;

double threadTime_us() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

// Each face reaches through the whole workspace, so that no box rules it out.
geometry::TriangleMesh wideFaces(std::size_t count, bool copies) {
  geometry::TriangleMesh mesh;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place(-kHalf_mm, kHalf_mm);
  const std::size_t different = copies ? 1 : count;
  for (std::size_t i = 0; i < different; ++i) {
    mesh.vertices.emplace_back(-kHalf_mm, place(random), place(random));
    mesh.vertices.emplace_back(kHalf_mm, place(random), place(random));
    mesh.vertices.emplace_back(place(random), kHalf_mm, place(random));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(3 * (i % different));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

Samples ticksAmong(const geometry::TriangleMesh& mesh, double seconds) {
  const auto scene = sceneOf(mesh);
  realtime::Renderer renderer({.toolRadius_m = 0, .forceShading = false});
  device::DeviceState state;
  realtime::Rendering rendering;
  Samples samples;
  const auto ticks = static_cast<int>(seconds * 1e3);
  for (int i = 0; i < ticks; ++i) {
    // Through the middle of it all at 0.2 m/s, so that every tick meets faces.
    const double t = 1e-3 * i;
    state.position_m = 0.03 * Vec3(std::sin(6.7 * t), std::sin(5.3 * t), std::sin(4.1 * t));
    const double begin = threadTime_us();
    renderer.step(*scene, state, base::Nanos{1'000'000} * (i + 1), 1'000'000, rendering);
    samples.add(threadTime_us() - begin);
  }
  return samples;
}

}  // namespace

Outcome measureBurden(const Run& run) {
  Outcome outcome;
  const auto most = static_cast<std::size_t>(run.seconds(1, 6, 6) * 1e6);
  const auto row = [&](const std::string& what, const geometry::TriangleMesh& mesh) {
    run.progress(what);
    Row result{what, "us", {}, std::nullopt, {}, "processor time of the rendering thread"};
    std::thread thread([&] {
      becomeRealtime();
      result.ours = ticksAmong(mesh, run.seconds(3, 10, 30)).summary();
    });
    thread.join();
    result.checks.push_back({"longest", result.ours.max, 1000, false, {}});
    outcome.rows.push_back(result);
  };
  const std::string millions = std::to_string(most / 1'000'000) + " million";
  row("copies of one wide face, " + millions, wideFaces(most, true));
  row("wide faces, all different, " + millions, wideFaces(most, false));
  outcome.remarks.push_back(
      "A scene holds 6 million triangles by default; what a client sends beyond them, to 1 GB and more, is "
      "refused.");
  return outcome;
}

}  // namespace hapticd::bench

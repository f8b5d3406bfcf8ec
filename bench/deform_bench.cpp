// A mesh of 100k triangles whose vertices are all new at 60 Hz, against refitting Embree's own triangles.
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <thread>

#include "bench/all.h"
#include "bench/bare_index.h"
#include "bench/scenes.h"
#include "bench/servo_loop.h"
#include "bench/timing.h"
#include "bench/witness.h"

namespace hapticd::bench {
namespace {

constexpr std::size_t kTriangles = 100'000;
constexpr std::int64_t kFrame_ns = 16'666'667;
constexpr int kShapes = 8;

// The ball breathes by a tenth of a millimetre.
std::vector<std::vector<Vec3f>> shapesOf(const geometry::TriangleMesh& mesh) {
  std::vector<std::vector<Vec3f>> shapes;
  for (int k = 0; k < kShapes; ++k) {
    const auto scale =
        static_cast<float>(1 + 0.1 / kBallRadius_mm * std::sin(2 * std::numbers::pi * k / kShapes));
    std::vector<Vec3f> shape = mesh.vertices;
    for (Vec3f& v : shape) v *= scale;
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

double msSince(std::int64_t begin) {
  return static_cast<double>(nowNs() - begin) * 1e-6;
}

struct Frames {
  Samples ingest_ms, publish_ms, refit_ms;
};

}  // namespace

Outcome measureDeform(const Run& run) {
  const geometry::TriangleMesh& mesh = bumpyBall(kTriangles);
  const auto shapes = shapesOf(mesh);
  BareIndex bare(mesh, 1, BareIndex::Kind::refitted);
  scene::SceneConfig config;
  config.checkMeshes = false;
  scene::SceneBuilder builder(config);
  std::vector<scene::Notice> notices;
  tell(builder, 0, mesh, nowNs());
  ServoLoop loop;
  loop.snapshots().publish(builder.publish(nowNs() + 1'000'000'000, notices));
  loop.begin();
  const double seconds = run.seconds(5, 10, 60);
  run.progress("60 Hz for " + std::to_string(static_cast<int>(seconds)) + " s");

  Frames frames;
  LoopFigures late;
  std::uint64_t witnessLate = 0;
  std::jthread observer([&] {
    const Witness witness;
    late = loop.observe(seconds);
    witnessLate = witness.late();
  });
  std::int64_t due = nowNs() + 1'000'000'000;  // after the time that the first publication was told
  sleepUntilNs(due);
  const std::int64_t end = due + static_cast<std::int64_t>((seconds - 1) * 1e9);
  for (int k = 1; nowNs() < end; ++k) {
    const auto& shape = shapes[static_cast<std::size_t>(k % kShapes)];
    scene::SetVertices vertices{0, 0, shape};
    const std::int64_t begin = nowNs();
    builder.apply(1, scene::BeginBatch{}, begin, notices);
    builder.apply(1, std::move(vertices), begin, notices);
    builder.apply(1, scene::CommitBatch{}, begin, notices);
    frames.ingest_ms.add(msSince(begin));
    const std::int64_t taken = nowNs();
    loop.snapshots().collect();  // as the scene thread does: what nobody reads any more can be refitted
    auto snapshot = builder.publish(taken, notices);
    frames.publish_ms.add(msSince(taken));
    if (!snapshot) throw std::runtime_error("a new shape was not published");
    loop.snapshots().publish(std::move(snapshot));
    sleepUntilNs(due += kFrame_ns / 2);
    const std::int64_t other = nowNs();
    bare.refit(shape);
    frames.refit_ms.add(msSince(other));
    sleepUntilNs(due = std::max(due + kFrame_ns / 2, nowNs()));
  }
  observer.join();

  Outcome outcome;
  Row publish{"publish (copy and refit)", "ms", frames.publish_ms.summary(),
              frames.refit_ms.summary(),  {},   {}};
  publish.checks.push_back({"p50 ratio", publish.ratio(), 2});
  Row ticks{"wake-up error meanwhile", "us", late.wakeup_us.summary(), std::nullopt, {}, {}};
  ticks.checks.push_back({"ticks over 0.5 ms late", static_cast<double>(late.overruns),
                          static_cast<double>(witnessLate), false,
                          loop.realtimeGranted() ? "" : "no SCHED_FIFO"});
  outcome.rows = {publish,
                  {"taking the vertices in", "ms", frames.ingest_ms.summary(), std::nullopt, {}, {}},
                  ticks,
                  witnessRow(witnessLate),
                  {"tick meanwhile", "us", late.compute_us.summary(), std::nullopt, {}, {}}};
  return outcome;
}

}  // namespace hapticd::bench

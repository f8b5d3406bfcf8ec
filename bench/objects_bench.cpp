// Thousands of objects, one touched: resting, and all of them moved at 60 Hz.
#include <time.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "base/time.h"
#include "bench/all.h"
#include "bench/scenes.h"
#include "bench/servo_loop.h"
#include "bench/timing.h"
#include "bench/witness.h"
#include "realtime/render/renderer.h"

namespace hapticd::bench {
namespace {

constexpr base::Nanos kPeriod = 1'000'000;
constexpr std::int64_t kObjectsFrame_ns = 16'666'667;
constexpr double kSpacing_mm = 9;
constexpr double kClear_mm = 44;  // of the touched ball in the middle

std::array<double, 16> placedAt(const Vec3& p) {
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, p.x(), p.y(), p.z(), 1};
}

// A grid around the ball, nearest first or not: all of it is out of the hand's reach.
std::vector<Vec3> placesOf(int count) {
  std::vector<Vec3> places;
  const int half = 13;
  for (int x = -half; x <= half; ++x) {
    for (int y = -half; y <= half; ++y) {
      for (int z = -half; z <= half && static_cast<int>(places.size()) < count; ++z) {
        const Vec3 p = kSpacing_mm * Vec3(x, y, z);
        if (p.norm() > kClear_mm) places.push_back(p);
      }
    }
  }
  return places;
}

class CrowdedScene {
 public:
  explicit CrowdedScene(int objects) : places_(placesOf(objects - 1)), builder_(config()) {
    const geometry::TriangleMesh small = makeBumpyBall(100, 3);
    tell(builder_, 0, bumpyBall(1'000), 0);
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const auto id = static_cast<std::int32_t>(i + 1);
      tell(builder_, id, small, 0);
      builder_.apply(1, scene::SetTransform{id, placedAt(places_[i])}, 0, notices_);
    }
  }

  /// All objects a little to and fro, the touched one, too.
  void move(base::Nanos now) {
    const double way_mm = 0.5 * std::sin(3 * base::toSeconds(now));
    builder_.apply(1, scene::SetTransform{0, placedAt({0.1 * way_mm, 0, 0})}, now, notices_);
    for (std::size_t i = 0; i < places_.size(); ++i) {
      builder_.apply(
          1, scene::SetTransform{static_cast<std::int32_t>(i + 1), placedAt(places_[i] + Vec3(way_mm, 0, 0))},
          now, notices_);
    }
    notices_.clear();
  }
  std::shared_ptr<const scene::SceneSnapshot> publish(base::Nanos now) {
    return builder_.publish(now, notices_);
  }

 private:
  static scene::SceneConfig config() {
    scene::SceneConfig config;
    config.checkMeshes = false;
    return config;
  }
  std::vector<Vec3> places_;
  scene::SceneBuilder builder_;
  std::vector<scene::Notice> notices_;
};

void replay(realtime::Renderer& renderer, const scene::SceneSnapshot& scene,
            const std::vector<HandTick>& hand, std::size_t from, std::size_t to, base::Nanos& now,
            const FineClock& clock, Samples* into) {
  device::DeviceState state;
  realtime::Rendering rendering;
  for (std::size_t i = from; i < to; ++i) {
    state.position_m = hand[i].position_m;
    now += kPeriod;
    const double us = clock.timeUs([&] { renderer.step(scene, state, now, kPeriod, rendering); });
    if (into != nullptr && hand[i].act != Act::way) into->add(us);
  }
}

// Blocks of one scene and the other by turns.
Row resting(int objects, double seconds) {
  const FineClock clock;
  const std::vector<HandTick> hand = handOf(1);
  const auto many = CrowdedScene(objects).publish(1'000'000'000);
  const auto one = CrowdedScene(1).publish(1'000'000'000);
  realtime::Renderer inMany;
  realtime::Renderer inOne;
  base::Nanos nowMany = 2'000'000'000;
  base::Nanos nowOne = nowMany;
  replay(inMany, *many, hand, 0, hand.size(), nowMany, clock, nullptr);
  replay(inOne, *one, hand, 0, hand.size(), nowOne, clock, nullptr);
  Samples ours;
  Samples theirs;
  const std::int64_t end = nowNs() + static_cast<std::int64_t>(seconds * 1e9);
  for (std::size_t at = 0; nowNs() < end; at = (at + 260) % hand.size()) {
    const std::size_t stop = std::min(at + 260, hand.size());
    replay(inMany, *many, hand, at, stop, nowMany, clock, &ours);
    replay(inOne, *one, hand, at, stop, nowOne, clock, &theirs);
  }
  Row row{std::to_string(objects) + " resting objects", "us", ours.summary(), theirs.summary(), {}, {}};
  if (objects == 10'000) row.checks.push_back({"p50 ratio", row.ratio(), 2});
  return row;
}

double cpuTimeUs() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) * 1e6 + static_cast<double>(time.tv_nsec) * 1e-3;
}

// Nearly the same face again and again, so that the box of each holds the whole workspace: the index cannot
// tell them apart, and equal ones are dropped.
geometry::TriangleMesh crossedFaces(std::size_t count) {
  geometry::TriangleMesh mesh;
  mesh.vertices.reserve(3 * count);
  mesh.triangles.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const float shift = static_cast<float>(i) * 40.0F / static_cast<float>(count) - 20.0F;
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.emplace_back(-300.0F, -300.0F + shift, -300.0F);
    mesh.vertices.emplace_back(300.0F, -300.0F + shift, 300.0F);
    mesh.vertices.emplace_back(0.0F, 300.0F + shift, 0.0F);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

// The longest tick in CPU time, whatever triangles a client sends.
Row crowdedFaces(std::size_t count, double seconds) {
  const std::vector<HandTick> hand = handOf(1);
  const auto scene = sceneOf(crossedFaces(count));
  realtime::Renderer renderer;
  device::DeviceState state;
  realtime::Rendering rendering;
  Samples ours;
  base::Nanos now = 2'000'000'000;
  const std::int64_t end = nowNs() + static_cast<std::int64_t>(seconds * 1e9);
  for (std::size_t i = 0; nowNs() < end; i = (i + 1) % hand.size()) {
    state.position_m = hand[i].position_m;
    now += kPeriod;
    const double before = cpuTimeUs();
    renderer.step(*scene, state, now, kPeriod, rendering);
    ours.add(cpuTimeUs() - before);
  }
  Row row{std::to_string(count) + " faces whose boxes hold the workspace: CPU time of a tick",
          "us",
          ours.summary(),
          std::nullopt,
          {},
          {}};
  row.checks.push_back({"longest tick, us of CPU time", row.ours.max, 1000});
  return row;
}

struct Moved {
  LoopFigures loop;
  std::uint64_t witnessLate = 0;
  Samples publish_ms;
};

// The real loop, while another thread moves everything at 60 Hz, or does nothing.
Moved observeMoving(int objects, bool move, double seconds) {
  Moved moved;
  ServoLoop loop;
  CrowdedScene crowd(objects);
  loop.snapshots().publish(crowd.publish(nowNs()));
  loop.begin();
  std::atomic<bool> stop{false};
  std::thread publisher([&] {
    for (std::int64_t due = nowNs(); move && !stop;
         sleepUntilNs(due = std::max(due + kObjectsFrame_ns, nowNs()))) {
      const std::int64_t begin = nowNs();
      crowd.move(begin);
      if (auto snapshot = crowd.publish(begin)) loop.snapshots().publish(std::move(snapshot));
      moved.publish_ms.add(static_cast<double>(nowNs() - begin) * 1e-6);
    }
  });
  loop.observe(0.3);
  const Witness witness;
  moved.loop = loop.observe(seconds);
  moved.witnessLate = witness.late();
  stop = true;
  publisher.join();
  return moved;
}

}  // namespace

Outcome measureObjects(const Run& run) {
  Outcome outcome;
  for (const int objects : {1'000, 10'000}) {
    run.progress(std::to_string(objects) + " resting objects");
    outcome.rows.push_back(resting(objects, run.seconds(2, 5, 30)));
  }
  // 5 million faces of their own corners are as many as an object holds: 15 million vertices.
  const std::size_t faces = run.length == Length::windows ? 1'000'000 : 5'000'000;
  run.progress(std::to_string(faces) + " faces whose boxes hold the workspace");
  outcome.rows.push_back(crowdedFaces(faces, run.seconds(2, 5, 30)));
  run.progress("10000 objects moving at 60 Hz");
  const double seconds = run.seconds(4, 10, 60);
  const Moved quiet = observeMoving(10'000, false, seconds);
  const Moved moving = observeMoving(10'000, true, seconds);
  const std::string reason = realtimeGranted() ? "" : "no SCHED_FIFO";
  Row lateness{"10,000 moving at 60 Hz: wake-up error, against the same resting",
               "us",
               moving.loop.wakeup_us.summary(),
               quiet.loop.wakeup_us.summary(),
               {},
               {}};
  lateness.checks.push_back({"ticks over 0.5 ms late", static_cast<double>(moving.loop.overruns),
                             static_cast<double>(std::max(quiet.loop.overruns, moving.witnessLate)), false,
                             reason});
  outcome.rows.push_back(lateness);
  outcome.rows.push_back(witnessRow(moving.witnessLate, quiet.witnessLate));
  outcome.rows.push_back({"10,000 moving at 60 Hz: tick, against the same resting",
                          "us",
                          moving.loop.compute_us.summary(),
                          quiet.loop.compute_us.summary(),
                          {},
                          {}});
  outcome.rows.push_back({"10,000 moving at 60 Hz: 10,000 poses taken and published",
                          "ms",
                          moving.publish_ms.summary(),
                          std::nullopt,
                          {},
                          {}});
  return outcome;
}

}  // namespace hapticd::bench

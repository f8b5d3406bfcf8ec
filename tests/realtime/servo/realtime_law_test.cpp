// The law of the realtime folder: a tick never allocates, frees or locks, even while the scene changes.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <numbers>
#include <random>
#include <shared_mutex>
#include <thread>

#include "device/simulated/simulated_device.h"
#include "device/simulated/waypoint_path.h"
#include "realtime/servo/forbidden_calls.h"
#include "realtime/servo/servo_thread.h"
#include "realtime/servo/tick.h"

namespace hapticd::realtime {
namespace {

constexpr Nanos kMs = 1'000'000;
constexpr double kRadius_mm = 25;

class RealtimeLaw : public testing::Test {
 protected:
  RealtimeLaw() { law::forget(); }
  ~RealtimeLaw() override { law::leave(); }
};

// First: the interposer catches every forbidden call.
TEST_F(RealtimeLaw, EveryForbiddenCallIsCaught) {
  std::mutex mutex;
  std::shared_mutex shared;
  int* volatile kept = nullptr;
  struct alignas(64) Wide {
    char bytes[64];
  };
  Wide* volatile wide = nullptr;
  const auto caught = [](const auto& forbidden) {
    law::forget();
    law::enter();
    forbidden();
    law::leave();
    return law::violations();
  };
  EXPECT_GT(caught([&] { kept = new int(1); }), 0);
  EXPECT_GT(caught([&] { delete kept; }), 0);
  EXPECT_STREQ(law::firstViolation(), "free");
  EXPECT_GT(caught([&] { kept = static_cast<int*>(std::malloc(4)); }), 0);
  EXPECT_GT(caught([&] { kept = static_cast<int*>(std::realloc(kept, 4000)); }), 0);
  EXPECT_GT(caught([&] { std::free(kept); }), 0);
  EXPECT_GT(caught([&] { wide = new Wide; }), 0);
  EXPECT_GT(caught([&] { delete wide; }), 0);
  EXPECT_GT(caught([&] { std::lock_guard lock(mutex); }), 0);
  EXPECT_STREQ(law::firstViolation(), "pthread_mutex_lock");
  EXPECT_GT(caught([&] { std::shared_lock lock(shared); }), 0);
  EXPECT_GT(caught([&] { std::unique_lock lock(shared); }), 0);
  EXPECT_GT(caught([&] {
              try {
                throw 1;
              } catch (int) {
              }
            }),
            0);
  EXPECT_EQ(caught([] {}), 0);
}

TEST_F(RealtimeLaw, OtherThreadsMayDoAsTheyLike) {
  law::enter();
  std::atomic<bool> go{false};
  law::leave();
  std::thread other([&] {
    while (!go) std::this_thread::yield();
    delete new int(1);
    go = false;
  });
  law::enter();
  go = true;
  while (go) std::this_thread::yield();
  law::leave();
  other.join();
  EXPECT_EQ(law::violations(), 0);
}

std::shared_ptr<const scene::MeshGeometry> ball(int rings, double bump) {
  auto vertices = std::make_shared<std::vector<geometry::Vec3f>>();
  auto triangles = std::make_shared<std::vector<geometry::Triangle>>();
  const int columns = 2 * rings;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double polar = std::numbers::pi * i / rings;
      const double turn = 2 * std::numbers::pi * j / columns;
      const double radius = kRadius_mm * (1 + bump * std::sin(9 * polar) * std::cos(9 * turn));
      vertices->emplace_back((radius * Vec3(std::sin(polar) * std::cos(turn), std::cos(polar),
                                            -std::sin(polar) * std::sin(turn)))
                                 .cast<float>());
    }
  }
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < columns; ++j) {
      const auto at = [&](int ring, int column) {
        return static_cast<std::uint32_t>(ring * columns + column % columns);
      };
      triangles->push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      triangles->push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  auto mesh = std::make_shared<scene::MeshGeometry>();
  static std::uint64_t topology = 0;
  mesh->topology = ++topology;
  mesh->triangles = triangles;
  mesh->vertices = vertices;
  mesh->index =
      scene::SpatialIndex::build(static_cast<std::uint32_t>(triangles->size()), [&](std::uint32_t id) {
        geometry::Box box;
        for (const auto corner : (*triangles)[id]) box.extend((*vertices)[corner].cast<double>());
        return box;
      });
  mesh->bounds = mesh->index.bounds();
  return mesh;
}

// Makes scenes that differ in number, shape, place, motion and surface of objects, and in effects.
class Scenery {
 public:
  Scenery() : meshes_{ball(40, 0), ball(60, 0.02), ball(80, 0.005)} {}

  std::shared_ptr<const scene::SceneSnapshot> next(Nanos now) {
    auto snapshot = std::make_shared<scene::SceneSnapshot>();
    snapshot->revision = ++revision_;
    const auto count = revision_ % 101 == 0 ? 0U : 1 + random_() % 3;
    for (std::uint32_t id = 0; id < count; ++id)
      snapshot->objects.push_back(object(static_cast<int>(id), now));
    const auto& objects = snapshot->objects;
    snapshot->objectIndex =
        std::make_shared<scene::SpatialIndex>(scene::SpatialIndex::build(count, [&](std::uint32_t id) {
          geometry::Box box;
          for (const auto& at : {objects[id]->motion.origin(), objects[id]->motion.destination()}) {
            box.extend(Vec3(at.translation() - Vec3::Constant(2 * kRadius_mm)));
            box.extend(Vec3(at.translation() + Vec3::Constant(2 * kRadius_mm)));
          }
          return box;
        }));
    for (int i = 0; i < 6; ++i) snapshot->effects.push_back(effect(i));
    return snapshot;
  }

 private:
  std::shared_ptr<const scene::ObjectState> object(int id, Nanos now) {
    auto state = std::make_shared<scene::ObjectState>();
    state->id = id;
    state->mesh = meshes_[random_() % 3];
    state->surface = {500, 0.5, 0.5, 0.3, revision_ % 5 == 0 ? 1.0 : 0.0, 0};
    const geometry::Affine from(Eigen::Translation3d(id * 15.0, 0, 0));
    geometry::Affine to = from;
    to.translation() += Vec3(0.01 * static_cast<double>(random_() % 300), 0, 0);
    state->motion = random_() % 2 == 0 ? scene::Motion::between(from, to, now, now + 20 * kMs)
                                       : scene::Motion::fixed(to, static_cast<std::uint32_t>(revision_ / 7));
    return state;
  }
  scene::Effect effect(int index) const {
    scene::Effect effect;
    effect.index = index;
    effect.type = static_cast<scene::EffectType>(index);
    effect.gain = 100;
    effect.magnitude_N = 0.3;
    effect.duration = index % 2 == 0 ? 0 : 50 * kMs;
    effect.angularFrequency_rad_per_s = 200;
    effect.direction = Vec3::UnitY();
    effect.start = static_cast<std::uint32_t>(revision_ / 10);
    return effect;
  }

  std::array<std::shared_ptr<const scene::MeshGeometry>, 3> meshes_;
  std::uint64_t revision_ = 0;
  std::mt19937 random_{5};
};

// Strokes over the ball, a little inside of it.
std::shared_ptr<const device::HandPath> strokes(int variant) {
  std::vector<device::Waypoint> points;
  for (int i = 0; i <= 40; ++i) {
    const double turn = 0.3 * i + variant;
    const double radius_m = (i % 8 == 0 ? 0.035 : 0.022);
    points.push_back({0.12 * i, radius_m * Vec3(std::cos(turn), std::sin(turn), 0.1 * std::sin(3 * turn)),
                      geometry::Quat(Eigen::AngleAxisd(0.3 * std::sin(turn), Vec3::UnitX())),
                      i % 10 == 3 ? 1U : 0U});
  }
  return std::make_shared<device::WaypointPath>(std::move(points), device::WaypointPath::Repeat::yes);
}

TickOptions simulatedHand() {
  TickOptions options;
  options.guard = GuardOptions::of(device::profiles().front());
  options.guard.selfRecover = true;
  return options;
}

void expectLawful() {
  EXPECT_EQ(law::violations(), 0) << "first: " << law::firstViolation();
  if (law::violations() > 0) law::printFirstViolation();
}

TEST_F(RealtimeLaw, HoldsInSimulatedTime) {
  device::SimulatedDevice device;
  base::SimulatedClock clock;
  Tick tick(device, clock, simulatedHand());
  RecordRing recorded(64);
  tick.recordTo({.ticks = &recorded});
  Scenery scenery;
  std::uint64_t touching = 0;
  std::uint64_t forces = 0;
  std::uint64_t kept = 0;
  for (Nanos i = 0; i < 30'000; ++i) {
    if (i % 37 == 0) tick.snapshots().publish(scenery.next(i * kMs));
    if (i % 5'000 == 0) device.setPath(strokes(static_cast<int>(i / 5'000)));
    if (i % 7'919 == 7'918) tick.control().stop();
    if (i % 7'919 == 0) tick.control().rearm();
    law::enter();
    tick(i * kMs);
    law::leave();
    touching += tick.last().rendering.touching;
    forces += tick.last().force_N.norm() > 0.1;
    tick.reports().consume([](const TickReport&) {});
    // The recorder is late from time to time, and ticks are dropped.
    if (i % 100 == 99) kept += recorded.consume([](const TickRecord&) {});
  }
  expectLawful();
  EXPECT_EQ(kept, 300U * 64);
  EXPECT_EQ(recorded.dropped(), 30'000U - kept);
  EXPECT_GT(touching, 2'000U);
  EXPECT_GT(forces, 5'000U);
}

TEST_F(RealtimeLaw, HoldsInTheServoThreadWhileScenesAreSwapped) {
  device::SimulatedDevice device;
  base::MonotonicClock clock;
  Tick tick(device, clock, simulatedHand());
  RecordRing recorded(1024);
  tick.recordTo({.ticks = &recorded});
  ServoThread thread(
      [&](const Pacing& pacing) {
        law::enter();
        tick(pacing);
        law::leave();
      },
      clock);
  device.setPath(strokes(0));
  Scenery scenery;
  tick.snapshots().publish(scenery.next(clock.now()));
  thread.start();
  std::uint64_t ticks = 0;
  std::uint64_t touching = 0;
  for (int swaps = 0; ticks < 2'000 || swaps < 100; ++swaps) {
    tick.snapshots().publish(scenery.next(clock.now()));
    if (swaps % 50 == 49) device.setPath(strokes(swaps / 50));
    tick.reports().consume([&](const TickReport& report) {
      ticks = report.tick;
      touching += report.rendering.touching;
    });
    recorded.consume([](const TickRecord&) {});
    clock.sleepUntil(clock.now() + 3 * kMs);  // leaves the processor to the servo; decides nothing
  }
  thread.stop();
  expectLawful();
  EXPECT_GT(touching, 0U);
  const auto compute = tick.histograms().compute.copy();
  const auto wakeup = tick.histograms().wakeupError.copy();
  RecordProperty("compute_p50_ns", std::to_string(compute.quantile(0.5)));
  RecordProperty("compute_p99_ns", std::to_string(compute.quantile(0.99)));
  RecordProperty("wakeup_p99_ns", std::to_string(wakeup.quantile(0.99)));
  std::printf("compute us p50 %.1f p99 %.1f max %.1f; wake-up us p50 %.1f p99 %.1f max %.1f; %s\n",
              1e-3 * static_cast<double>(compute.quantile(0.5)),
              1e-3 * static_cast<double>(compute.quantile(0.99)), 1e-3 * static_cast<double>(compute.max),
              1e-3 * static_cast<double>(wakeup.quantile(0.5)),
              1e-3 * static_cast<double>(wakeup.quantile(0.99)), 1e-3 * static_cast<double>(wakeup.max),
              thread.setup().scheduling.text.c_str());
}

}  // namespace
}  // namespace hapticd::realtime

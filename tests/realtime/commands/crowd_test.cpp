// Thousands of objects whose boxes surround the HIP.
#include <ctime>

#include <algorithm>
#include <iostream>
#include <random>

#include "loop.h"
#include "realtime/render/meshes.h"
#include "realtime/render/object_distances.h"
#include "reduced.h"

namespace hapticd::realtime::commands {
namespace {

double cpuTime_us() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

// A square of this half size around a point of a plane, front along the normal, millimetres.
std::vector<Vec3f> square(const Vec3& centre, const Vec3& normal, double half) {
  const Vec3 u = half * normal.unitOrthogonal();
  const Vec3 v = normal.cross(u);
  std::vector<Vec3f> out;
  for (const auto& [a, b] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}})
    out.emplace_back((centre + a * u + b * v).cast<float>());
  return out;
}

class Crowd : public testing::TestWithParam<int> {
 protected:
  static scene::SceneConfig roomy() {
    scene::SceneConfig config;
    config.limits.objects = 20'000;
    return config;
  }
  // The last object, so that it is the last of any candidates.
  void addFloor() { loop.add(GetParam(), sheetTriples(60)); }

  struct Times {
    std::vector<double> us;
    double at(double share) {
      std::sort(us.begin(), us.end());
      return us[static_cast<std::size_t>(share * static_cast<double>(us.size() - 1))];
    }
  };
  void press(Times& times, std::uint32_t& status) {
    Vec3 hip(0.001, 0.001, 0.002);
    loop.rest(hip, toNanos(1));
    status = 0;
    for (int i = 0; i < 4000; ++i) {
      const double share = std::min(1.0, i / 300.0);
      hip = Vec3(0.001 + 0.005 * std::sin(0.002 * i), 0.001 - 0.003 * share, 0.002);
      loop.now += kMs;
      const double begin = cpuTime_us();
      loop.render(hip, kMs);
      times.us.push_back(cpuTime_us() - begin);
      status |= loop.out.status;
      if (share == 1) {
        ASSERT_NEAR(loop.out.force_N.y(), 0.002 * kStiffness_N_per_m, 1e-3) << i;
      }
    }
  }

  std::mt19937 random{5};
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); }
  Vec3 direction() { return Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized(); }
  Loop loop{{}, roomy()};
};
#ifdef HAPTICD_SANITIZED
INSTANTIATE_TEST_SUITE_P(, Crowd, testing::Values(65, 100, 1'000));
#else
INSTANTIATE_TEST_SUITE_P(, Crowd, testing::Values(65, 100, 1'000, 10'000));
#endif

// Each object is two small squares in opposite corners around the hand.
TEST_P(Crowd, floor_among_wide_objects_is_felt) {
  loop.send(scene::SetObjectNumber{GetParam() + 1});
  for (int i = 0; i < GetParam(); ++i) {
    const Vec3 corner(uniform(50, 70), uniform(50, 70), uniform(50, 70));
    std::vector<Vec3f> frame = square(corner, direction(), 2);
    const std::vector<Vec3f> other = square(-corner, direction(), 2);
    frame.insert(frame.end(), other.begin(), other.end());
    loop.add(i, std::move(frame));
  }
  addFloor();
  Times times;
  std::uint32_t status = 1;
  press(times, status);
  EXPECT_EQ(status, 0U);
  std::cout << GetParam() << " wide objects: p50 " << times.at(0.5) << " us, p99 " << times.at(0.99)
            << " us, max " << times.us.back() << " us\n";
}

// Large tilted sheets at 8 to 60 mm from the hand: the boxes of most of them contain it.
TEST_P(Crowd, floor_among_tilted_sheets_is_felt) {
  loop.send(scene::SetObjectNumber{GetParam() + 1});
  std::vector<std::pair<Vec3, double>> sheets;
  for (int i = 0; i < GetParam(); ++i) {
    const Vec3 normal = direction();
    const double distance = uniform(8, 60);
    sheets.emplace_back(normal, distance);
    loop.add(i, square(-distance * normal, normal, 120));
  }
  addFloor();
  Times times;
  std::uint32_t status = 1;
  press(times, status);
  EXPECT_EQ(status, 0U);
  std::cout << GetParam() << " tilted sheets: p50 " << times.at(0.5) << " us, p99 " << times.at(0.99)
            << " us, max " << times.us.back() << " us\n";
  // Upwards until the first sheet holds the hand.
  double height_mm = 1e9;
  Vec3 normal = Vec3::Zero();
  const Vec3 from(1, 1, 2);
  for (const auto& [n, d] : sheets) {
    const double rate = n.y();
    if (rate >= -0.3) continue;
    const double way = (n.dot(from) + d) / -rate;
    if (way < height_mm) {
      height_mm = way;
      normal = n;
    }
  }
  loop.to(1e-3 * from);
  loop.to(1e-3 * (from + Vec3(0, height_mm - 0.5, 0)));
  EXPECT_NEAR(loop.out.force_N.norm(), 0, 1e-3) << height_mm;
  loop.to(1e-3 * (from + Vec3(0, height_mm + 0.3, 0)));
  // In the densest crowd the proxy lags behind while objects are examined.
  loop.rest(1e-3 * (from + Vec3(0, height_mm + 0.3, 0)), 20 * kMs);
  EXPECT_GT(loop.out.force_N.dot(normal), 0.2 * 0.3e-3 * kStiffness_N_per_m) << height_mm;
}

// A tenth of the objects move at 60 Hz, and one of them is a sheet that rises under the hand.
TEST_P(Crowd, moving_sheet_in_a_crowd_takes_the_hand_along) {
  if (GetParam() > 1'000) GTEST_SKIP() << "thousands of snapshots of all objects";
  loop.send(scene::SetObjectNumber{GetParam() + 1});
  for (int i = 0; i < GetParam(); ++i) {
    const Vec3 corner(uniform(50, 70), uniform(50, 70), uniform(50, 70));
    std::vector<Vec3f> frame = square(corner, direction(), 2);
    const std::vector<Vec3f> other = square(-corner, direction(), 2);
    frame.insert(frame.end(), other.begin(), other.end());
    loop.add(i, std::move(frame));
  }
  addFloor();
  loop.place(GetParam(), {0, -10, 0});
  const Vec3 hip(0.001, 0, 0.002);
  loop.rest(hip, toNanos(1));
  const int moving = std::min(60, GetParam() / 10);
  std::uint32_t status = 0;
  for (int frame = 0; frame < 120; ++frame) {
    for (int i = 0; i < moving; ++i) loop.place(i, {3 * std::sin(0.1 * frame + i), 0, 0});
    loop.place(GetParam(), {0, std::min(4.0, -10 + 0.8 * frame), 0});
    loop.rest(hip, 16 * kMs, [&] { status |= loop.out.status; });
  }
  EXPECT_NEAR(loop.out.force_N.y(), 0.004 * kStiffness_N_per_m, 1e-3);
  EXPECT_EQ(status, 0U);
}

// What the tool reaches on a way of many metres is found, or known to be unknown.
TEST(Distances, hold_over_metres_of_travel) {
  constexpr double kReach_m = 0.010;
  constexpr std::int32_t kObjects = 200;
  std::mt19937 random{7};
  std::uniform_real_distribution<double> place_mm(-400, 400);
  Loop loop;
  std::vector<Vec3> centres_m;
  loop.send(scene::SetObjectNumber{kObjects});
  for (std::int32_t i = 0; i < kObjects; ++i) {
    const Vec3 centre_mm(place_mm(random), place_mm(random), place_mm(random));
    centres_m.push_back(1e-3 * centre_mm);
    loop.add(i, square(centre_mm, Vec3::UnitY(), 1));
  }
  loop.rest(Vec3::Zero(), toNanos(1));
  ASSERT_EQ(loop.scene().objects.size(), centres_m.size());
  const auto distances = std::make_unique<ObjectDistances>();
  ObjectDistances::Nearest nearest;
  const auto contains = [&](std::uint32_t i) {
    const auto end = nearest.candidates.begin() + nearest.count;
    return std::any_of(nearest.candidates.begin(), end, [&](const auto& c) { return c.object == i; });
  };
  double travel_m = 0;
  Vec3 last = Vec3::Zero();
  for (std::size_t k = 0; k < centres_m.size(); ++k) {
    const Vec3 tool = centres_m[k] + Vec3(0, 0.005, 0);
    travel_m += (tool - std::exchange(last, tool)).norm();
    distances->findNearest(loop.scene(), loop.now, loop.now - kMs, tool, kReach_m, nearest);
    loop.now += kMs;
    for (std::uint32_t i = 0; i < centres_m.size(); ++i) {
      const double most_m = (centres_m[i] - tool).norm();
      if (most_m <= kReach_m) {
        ASSERT_TRUE(contains(i) || nearest.free_m <= most_m) << i << " after " << travel_m << " m";
      }
    }
  }
  EXPECT_GT(travel_m, 40);
}

// Floors of square boxes, each an object of its own: more of them are near the hand than a tick examines.
struct TiledFloor {
  int rows;
  double size_mm;
  double radius_m;
  double speed_m_per_s;
  double depth_m;
};

TEST(Tiles, are_a_floor) {
  int combination = 0;
  for (const TiledFloor& floor : {TiledFloor{20, 0.5, 0, 0.02, 0.005},
                                  {40, 0.5, 0, 0.1, 0.002},
                                  {40, 1, 0.001, 0.1, 0.003},
                                  {12, 2, 0.001, 0.02, 0.005},
                                  {40, 2, 0, 0.1, 0.008}}) {
    if (!tried(combination++)) continue;
    RenderOptions options;
    options.toolRadius_m = floor.radius_m;
    Loop loop{options};
    const int count = floor.rows * floor.rows;
    loop.send(scene::SetObjectNumber{count});
    for (int i = 0; i < count; ++i) {
      const Vec3 lower(i / floor.rows - floor.rows / 2 - 0.5, -1, i % floor.rows - floor.rows / 2 - 0.5);
      loop.add(i, boxTriples(floor.size_mm * lower, floor.size_mm * (lower + Vec3::Ones())));
    }
    Vec3 hip(0.31e-3 * floor.size_mm, floor.radius_m + 0.003, 0.22e-3 * floor.size_mm);
    const auto slide = [&](const Vec3& to) {
      const Vec3 from = hip;
      const int ticks = static_cast<int>((to - from).norm() / (1e-3 * floor.speed_m_per_s));
      for (int i = 1; i <= ticks; ++i) {
        loop.now += kMs;
        hip = from + (to - from) * (static_cast<double>(i) / ticks);
        loop.render(hip, kMs);
        const double depth_m = floor.radius_m - hip.y();
        if (depth_m < 0.001) continue;
        ASSERT_NEAR(loop.out.force_N.y(), depth_m * kStiffness_N_per_m, 1e-3)
            << floor.rows << " rows of " << floor.size_mm << " mm, " << hip.transpose();
      }
    };
    loop.rest(hip, toNanos(0.3));
    const Vec3 above = hip;
    const Vec3 pressed(hip.x(), -floor.depth_m, hip.z());
    const double way_m = 0.35e-3 * floor.rows * floor.size_mm;
    for (const Vec3& to : {pressed, Vec3(pressed + Vec3(way_m, 0, 0.6 * way_m)),
                           Vec3(pressed - Vec3(way_m, 0, 0.3 * way_m)), pressed, above}) {
      slide(to);
      if (HasFatalFailure()) return;
    }
    EXPECT_EQ(loop.out.force_N.norm(), 0);
  }
}

// The triangles of a sphere, each in any of the objects: all of their boxes are around the hand.
TEST(Scattered, triangles_are_one_surface) {
  constexpr double kRadius_m = 0.015;
  const geometry::TriangleMesh sphere = fixture::sphere(kRadius_m, 30);
  const auto corner = [&](std::uint32_t id) { return Vec3f(1e3F * sphere.vertices[id]); };
  for (const int objects : {70, 100, 300}) {
    std::mt19937 random(7);
    std::vector<std::vector<Vec3f>> parts(static_cast<std::size_t>(objects));
    std::vector<Vec3f> all;
    for (const auto& triangle : sphere.triangles) {
      auto& part = parts[random() % parts.size()];
      for (const std::uint32_t id : triangle) part.push_back(corner(id)), all.push_back(corner(id));
    }
    Loop whole;
    whole.add(0, all);
    Loop scattered;
    scattered.send(scene::SetObjectNumber{objects});
    for (int i = 0; i < objects; ++i) scattered.add(i, std::move(parts[static_cast<std::size_t>(i)]));
    for (Loop* loop : {&whole, &scattered}) loop->rest(Vec3(kRadius_m + 0.002, 0, 0), toNanos(0.3));
    for (int i = 0; i < reduced(3000, 600); ++i) {
      const double angle = 0.004 * i;
      const double height_m = std::max(0.002 - 1e-5 * i, -0.002);
      const Vec3 hip = (kRadius_m + height_m) *
                       Vec3(std::cos(angle), std::sin(angle), 0.3 * std::sin(2 * angle)).normalized();
      for (Loop* loop : {&whole, &scattered}) {
        loop->now += kMs;
        loop->render(hip, kMs);
      }
      ASSERT_NEAR((whole.out.force_N - scattered.out.force_N).norm(), 0, 0.02)
          << objects << " objects, tick " << i;
    }
    EXPECT_GT(whole.out.force_N.norm(), 0.9);
  }
}

// More copies of one face than a tick examines: the index has it once.
TEST(Copies, of_one_face_are_felt_as_one) {
  Loop loop;
  std::vector<Vec3f> copies;
  for (int i = 0; i < reduced(20'000, 10'000); ++i) {
    const std::vector<Vec3f> sheet = sheetTriples(60);
    copies.insert(copies.end(), sheet.begin(), sheet.end());
  }
  loop.add(0, std::move(copies));
  Vec3 hip(0.001, 0.001, 0.002);
  loop.rest(hip, toNanos(1));
  for (int i = 1; i <= 500; ++i) {
    hip.y() = 0.001 - 0.003 * std::min(1.0, i / 300.0);
    loop.now += kMs;
    loop.render(hip, kMs);
    ASSERT_EQ(loop.out.status, 0U) << i;
  }
  EXPECT_NEAR(loop.out.force_N.y(), 0.002 * kStiffness_N_per_m, 1e-3);
}

}  // namespace
}  // namespace hapticd::realtime::commands

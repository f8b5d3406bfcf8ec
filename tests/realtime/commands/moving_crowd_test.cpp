// A floor rises into a resting hand among many other objects that move or deform. Their boxes surround the
// hand, their surfaces stay more than 25 mm away.
#include <cmath>
#include <functional>
#include <ostream>
#include <random>

#include "loop.h"
#include "reduced.h"

namespace hapticd::realtime::commands {
namespace {

constexpr Nanos kFrame = 16 * kMs;

enum class Kind { rests, moves, turns, deforms };

struct Case {
  const char* name;
  int others;
  Kind crowd;
  Kind floor;
  bool floorLast;
};
void PrintTo(const Case& crowd, std::ostream* out) {
  *out << crowd.name << ' ' << crowd.others;
}

// The object turns about a pivot at the hand, far from its origin; `height` is that of the floor at the hand.
scene::SetTransform turned(std::int32_t id, double angle, const Vec3& pivot, const Vec3& by) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  // By columns: a turn about z.
  const Vec3 place =
      pivot - Vec3(c * pivot.x() - s * pivot.y(), s * pivot.x() + c * pivot.y(), pivot.z()) + by;
  return {id, {c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, place.x(), place.y(), place.z(), 1}};
}

class MovingCrowd : public testing::TestWithParam<std::tuple<Case, double>> {
 protected:
  static scene::SceneConfig roomy() {
    scene::SceneConfig config;
    config.limits.objects = 20'000;
    return config;
  }
  const Case& now() const { return std::get<0>(GetParam()); }
  double radius_mm() const { return 1e3 * std::get<1>(GetParam()); }
  int others() const { return now().others; }
  std::int32_t floorId() const { return now().floorLast ? others() : 0; }
  std::int32_t otherId(int i) const { return now().floorLast ? i : i + 1; }
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); }

  // Large sheets above the hand that face it.
  void addOthers(Loop& loop) {
    sheets.clear();
    std::normal_distribution<double> normal;
    for (int i = 0; i < others(); ++i) {
      Vec3 n(normal(random), 0, normal(random));
      n = (n.normalized() - Vec3::UnitY()).normalized();
      const Vec3 centre = -uniform(30, 70) * n;
      const Vec3 u = 200 * n.unitOrthogonal();
      const Vec3 v = n.cross(u);
      std::vector<Vec3f> sheet;
      for (const auto& [a, b] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}})
        sheet.emplace_back((centre + a * u + b * v).cast<float>());
      sheets.push_back(sheet);
      loop.add(otherId(i), std::move(sheet));
    }
  }
  // One frame of the others: each by up to 1 mm to and fro.
  void moveOthers(Loop& loop, double t_s) {
    for (int i = 0; i < others(); ++i) {
      const double phase = std::sin(5 * t_s + i);
      const std::int32_t id = otherId(i);
      if (now().crowd == Kind::moves) {
        loop.send(scene::SetTransform{id, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, phase, 0, 1}});
      } else if (now().crowd == Kind::turns) {
        loop.send(turned(id, 0.005 * phase, Vec3::Zero(), Vec3::Zero()));
      } else if (now().crowd == Kind::deforms) {
        std::vector<Vec3f> shape = sheets[static_cast<std::size_t>(i)];
        for (Vec3f& v : shape) v.y() += static_cast<float>(phase);
        loop.send(scene::SetVertices{id, 0, std::move(shape)});
      }
    }
  }
  void placeFloor(Loop& loop, double height_mm) {
    if (now().floor == Kind::deforms) {
      loop.send(scene::SetVertices{floorId(), 0, sheetTriples(60, height_mm)});
    } else {
      loop.send(scene::SetTransform{floorId(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, height_mm, 0, 1}});
    }
  }

  std::mt19937 random{7};
  std::vector<std::vector<Vec3f>> sheets;
};

std::vector<Case> cases() {
  std::vector<Case> all{
      {"floor_deforms", 58, Kind::rests, Kind::deforms, false},
      {"floor_deforms", 70, Kind::rests, Kind::deforms, false},
      {"floor_deforms", 120, Kind::rests, Kind::deforms, true},
      {"crowd_moves", 30, Kind::moves, Kind::moves, true},
      {"crowd_moves", 58, Kind::moves, Kind::moves, true},
      {"crowd_moves", 70, Kind::moves, Kind::moves, true},
      {"crowd_moves_floor_deforms", 70, Kind::moves, Kind::deforms, true},
      {"crowd_turns", 70, Kind::turns, Kind::moves, true},
      {"crowd_deforms", 58, Kind::deforms, Kind::moves, true},
      {"all_deform", 70, Kind::deforms, Kind::deforms, true},
#ifndef HAPTICD_SANITIZED  // 5 to 50 s each
      {"crowd_moves", 150, Kind::moves, Kind::moves, true},
      {"crowd_moves", 600, Kind::moves, Kind::moves, true},
      {"crowd_moves_floor_deforms", 150, Kind::moves, Kind::deforms, true},
      {"crowd_turns", 150, Kind::turns, Kind::moves, true},
      {"crowd_deforms", 150, Kind::deforms, Kind::moves, true},
      {"all_deform", 150, Kind::deforms, Kind::deforms, true},
#endif
  };
  return all;
}
INSTANTIATE_TEST_SUITE_P(, MovingCrowd,
                         testing::Combine(testing::ValuesIn(cases()), testing::Values(0.0, 0.002)),
                         [](const auto& test) {
                           const Case& c = std::get<0>(test.param);
                           return std::string(c.name) + "_" + std::to_string(c.others) +
                                  (std::get<1>(test.param) > 0 ? "_ball" : "_point");
                         });

// The floor rests for 0.4 s and then rises at 10 to 50 mm/s until it is 4 mm above the lowest point of the
// hand.
TEST_P(MovingCrowd, rising_floor_takes_the_hand_along) {
  constexpr double kDepth_mm = 4;
  const Vec3 hip(0.001, 1e-3 * radius_mm(), 0.002);
  const int runs = reduced(others() > 200 ? 2 : 8);
  for (int run = 0; run < runs; ++run) {
    Loop loop({.toolRadius_m = std::get<1>(GetParam())}, roomy());
    loop.send(scene::SetTouchableFaces{0});
    loop.send(scene::SetObjectNumber{others() + 1});
    const double speed_mm_per_s = uniform(10, 50);
    const double start_mm = uniform(-8, -4);
    addOthers(loop);
    const double drawn_mm = now().floor == Kind::deforms ? start_mm : 0;
    loop.add(floorId(), sheetTriples(60, drawn_mm));
    placeFloor(loop, start_mm);
    loop.rest(hip, 200 * kMs);
    double height_mm = start_mm;
    std::uint32_t status = 0;
    for (double t_s = 0; height_mm < kDepth_mm; t_s += base::toSeconds(kFrame)) {
      moveOthers(loop, t_s);
      const double next_mm = std::min(kDepth_mm, start_mm + speed_mm_per_s * std::max(0.0, t_s - 0.4));
      if (next_mm != height_mm) placeFloor(loop, next_mm);
      height_mm = next_mm;
      loop.rest(hip, kFrame, [&] { status |= loop.out.status; });
    }
    loop.rest(hip, 50 * kMs);
    EXPECT_NEAR(loop.out.force_N.y(), 1e-3 * kDepth_mm * kStiffness_N_per_m, 1e-3) << "run " << run;
    EXPECT_EQ(status, 0U) << "run " << run;
  }
}

// The same by a pose or a shape that follows a pause of 2 s.
TEST_P(MovingCrowd, floor_that_rises_after_a_pause_takes_the_hand_along) {
  if (others() > 200) GTEST_SKIP() << "long";
  const Vec3 hip(0.001, 1e-3 * radius_mm(), 0.002);
  Loop loop({.toolRadius_m = std::get<1>(GetParam())}, roomy());
  loop.send(scene::SetTouchableFaces{0});
  loop.send(scene::SetObjectNumber{others() + 1});
  addOthers(loop);
  loop.add(floorId(), sheetTriples(60, now().floor == Kind::deforms ? -9 : 0));
  placeFloor(loop, -9);
  loop.rest(hip, 200 * kMs);
  double felt_mm = 0;
  for (const double height_mm : {-1.0, 4.0}) {
    loop.rest(hip, toNanos(2));
    moveOthers(loop, height_mm);
    placeFloor(loop, height_mm);
    loop.rest(hip, 100 * kMs);
    felt_mm = std::max(0.0, height_mm);
    EXPECT_NEAR(loop.out.force_N.y(), 1e-3 * felt_mm * kStiffness_N_per_m, 1e-3) << height_mm;
  }
}

class StirredCrowd : public MovingCrowd {};
INSTANTIATE_TEST_SUITE_P(, StirredCrowd,
                         testing::Combine(testing::Values(Case{"", 58, Kind::moves, Kind::moves, true},
                                                          Case{"", reduced(150, 70), Kind::moves, Kind::moves,
                                                               true}),
                                          testing::Values(0.0, 0.002)),
                         [](const auto& test) {
                           return std::to_string(std::get<0>(test.param).others) +
                                  (std::get<1>(test.param) > 0 ? "_ball" : "_point");
                         });

// In each frame one more object comes or goes, before all others in the list.
TEST_P(StirredCrowd, rising_floor_takes_the_hand_along_while_objects_come_and_go) {
  const Vec3 hip(0.001, 1e-3 * radius_mm(), 0.002);
  Loop loop({.toolRadius_m = std::get<1>(GetParam())}, roomy());
  loop.send(scene::SetTouchableFaces{0});
  loop.send(scene::SetObjectNumber{others() + 1});
  addOthers(loop);
  loop.add(floorId(), sheetTriples(60));
  placeFloor(loop, -8);
  loop.rest(hip, 300 * kMs);
  for (int frame = 0; frame <= 40; ++frame) {
    loop.send(scene::SetTouchable{otherId(frame % 7), frame % 2 == 0});
    moveOthers(loop, 0.016 * frame);
    placeFloor(loop, std::min(4.0, -8 + 0.4 * frame));
    loop.rest(hip, kFrame);
  }
  loop.rest(hip, 50 * kMs);
  EXPECT_NEAR(loop.out.force_N.y(), 4e-3 * kStiffness_N_per_m, 1e-3);
}

// The workspace sinks into the floor with each frame, as with a camera that moves.
TEST_P(StirredCrowd, workspace_that_moves_takes_the_hand_along) {
  const Vec3 hip(0.001, 1e-3 * radius_mm(), 0.002);
  for (const double speed_mm : {0.2, 0.7}) {
    Loop loop({.toolRadius_m = std::get<1>(GetParam())}, roomy());
    loop.send(scene::SetTouchableFaces{0});
    loop.send(scene::SetObjectNumber{others() + 1});
    addOthers(loop);
    loop.add(floorId(), sheetTriples(60));
    placeFloor(loop, -8);
    loop.rest(hip, 300 * kMs);
    std::uint32_t status = 0;
    for (double sunk_mm = 0; sunk_mm < 12;) {
      sunk_mm = std::min(12.0, sunk_mm + speed_mm);
      loop.send(scene::SetHapticOrigin{Vec3(0, -1e-3 * sunk_mm, 0), Vec3::UnitX(), 0});
      loop.rest(hip, kFrame,
                [&] { status |= loop.out.status & ~static_cast<std::uint32_t>(kRenderGeometryJump); });
    }
    EXPECT_NEAR(loop.out.force_N.y(), 4e-3 * kStiffness_N_per_m, 1e-3) << speed_mm;
    EXPECT_EQ(status, 0U) << speed_mm;
  }
}

}  // namespace
}  // namespace hapticd::realtime::commands

// Surfaces whose gaps are below the gap tolerance of 10 µm are impassable, within one object and between
// objects; wider holes stay holes.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "realtime/render/renderer.h"
#include "truth/meshes.h"
#include "truth/stage.h"

namespace hapticd::truth {
namespace {

constexpr double kHalf_m = 0.02;
constexpr double kMargin_m = 20e-6;  // twice the tolerance

// In all tests together about nine times as many.
int seamCount() {
#ifdef HAPTICD_SANITIZED
  return 25;
#else
  return std::getenv("HAPTICD_LONG") != nullptr ? 12'000 : 250;
#endif
}

// Two plates that meet along the y axis, seen from +z, with a gap between them; or a pocket. `walls` bound
// the free space: all of them in a concave scene, one of them in a convex one.
struct Seam {
  Trial trial;
  std::vector<Wall> walls;
  bool concave = true;
  Point bottom = Point::Zero();  // direction into the seam
  double gap = 0;
  double bend = 0;
  double worst = 0;  // of the proxy, beyond the walls
};

enum class Parts { junction, objects, soup, pocket };

struct SeamCase {
  const char* name;
  Parts parts;
  bool ball;
};
void PrintTo(const SeamCase& c, std::ostream* out) {
  *out << c.name;
}

// Each triangle with corners of its own, moved by at most a third of the gap.
Shape torn(const Shape& shape, double gap, Dice& dice) {
  Shape out;
  for (const auto& t : shape.triangles) {
    const auto first = static_cast<std::uint32_t>(out.vertices.size());
    for (const std::uint32_t v : t)
      out.vertices.push_back(shape.vertices[v] + gap / 3 * dice.uniform(0, 1) * dice.direction());
    out.triangles.push_back({first, first + 1, first + 2});
  }
  return out;
}

// An own placement in the device frame, in millimetres, metres or another unit.
void addObject(Trial& trial, const Shape& shape, Dice& dice) {
  Pose pose;
  pose.position_m = dice.inCube(0.03);
  pose.rotation = dice.rotation();
  pose.scale = Point::Constant(dice.chance(0.5) ? 1e-3 : dice.logarithmic(1e-3, 10));
  trial.objects.push_back(bake(shape, pose));
  trial.objects.back().material.stiffness_N_per_m = 1000;
}

void makePlates(Seam& seam, Parts parts, Dice& dice) {
  const double third = dice.uniform(0, 3);
  seam.bend = third < 0.3 ? 0.0 : third < 2 ? dice.uniform(0.01, 1.4) : dice.uniform(-1.4, -0.01);
  const Point along(0, 2 * kHalf_m, 0);
  const Point right = kHalf_m * Point(std::cos(seam.bend), 0, std::sin(seam.bend));
  // Corners that are torn off, too, must not make the gap wider.
  const double apart_m = parts == Parts::soup ? seam.gap / 3 : seam.gap;
  const Point apart = apart_m * Point(1, 0, dice.uniform(-0.5, 0.5)).normalized();
  Shape a = patch({-kHalf_m, -kHalf_m, 0}, {kHalf_m, 0, 0}, along, dice.integer(1, 4), dice.integer(1, 7),
                  0.3, dice);
  Shape b =
      patch(Point(0, -kHalf_m, 0) + apart, right, along, dice.integer(1, 4), dice.integer(1, 7), 0.3, dice);
  seam.walls = {{-Point::UnitZ(), 0}, {Point(std::sin(seam.bend), 0, -std::cos(seam.bend)), 0}};
  seam.concave = seam.bend >= 0;
  seam.bottom = (seam.walls[0].normal + seam.walls[1].normal).normalized();
  if (parts == Parts::objects) {
    addObject(seam.trial, a, dice);
    addObject(seam.trial, b, dice);
    return;
  }
  a.append(b);
  addObject(seam.trial, parts == Parts::soup ? torn(a, seam.gap, dice) : a, dice);
}

void makePocket(Seam& seam, Dice& dice) {
  const Point half(dice.uniform(0.006, 0.02), dice.uniform(0.006, 0.02), dice.uniform(0.006, 0.02));
  addObject(seam.trial, pocket(half, 3, seam.gap, dice), dice);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) seam.walls.push_back({sign * Point::Unit(axis), half[axis]});
  }
  const int free = dice.integer(0, 3);  // an edge, or with 3 a corner
  for (int axis = 0; axis < 3; ++axis) {
    if (axis != free) seam.bottom[axis] = dice.chance(0.5) ? half[axis] : -half[axis];
  }
}

// Presses into the seam, tilted, and slides along it and across it.
void makeHand(Seam& seam, Parts parts, Dice& dice) {
  const bool pocket = parts == Parts::pocket;
  const Point aim = pocket ? seam.bottom : Point(0, dice.uniform(-0.6, 0.6) * kHalf_m, 0);
  const Point into = seam.bottom.normalized();
  const double radius = seam.trial.toolRadius_m;
  Point hip = pocket ? Point(Point::Zero())
                     : Point(aim - (0.004 + 1.5 * radius + 0.01 * (radius > 0 ? 1 : 0)) * into);
  std::vector<Point>& hips = seam.trial.hips;
  hips.push_back(hip);
  const auto move = [&](const Point& to, int ticks) {
    const Point from = hip;
    for (int i = 1; i <= ticks; ++i) hips.emplace_back(from + static_cast<double>(i) / ticks * (to - from));
    hip = to;
  };
  move(aim + dice.uniform(0.0005, 0.003) * into + dice.inCube(0.0005), dice.integer(20, 60));
  for (int i = 0; i < 3; ++i) {
    const Point to = aim + dice.uniform(0.0005, 0.003) * into + dice.inCube(0.002);
    move(to, dice.integer(5, 40));
  }
}

Seam makeSeam(Parts parts, bool ball, std::uint64_t seed) {
  Dice dice(seed);
  Seam seam;
  seam.gap = dice.chance(0.15) ? 0.0 : dice.logarithmic(1e-12, 9e-6);
  seam.trial.toolRadius_m = ball ? dice.logarithmic(0.5e-3, 5e-3) : 0.0;
  // A room with both sides touchable that appears around the hand is not felt until the hand has left it.
  seam.trial.sides = parts == Parts::pocket || dice.chance(0.5) ? Sides::front : Sides::both;
  if (parts == Parts::pocket) {
    makePocket(seam, dice);
  } else {
    makePlates(seam, parts, dice);
  }
  makeHand(seam, parts, dice);
  return seam;
}

// How far the proxy got beyond the walls.
double farthestBeyond(const Seam& seam) {
  Stage stage(seam.trial);
  realtime::Renderer renderer({seam.trial.toolRadius_m, false});
  realtime::Rendering rendering;
  double worst = 0;
  for (std::size_t i = 0; i < seam.trial.hips.size(); ++i) {
    device::DeviceState state;
    state.time = static_cast<base::Nanos>(i) * realtime::fixture::kTick;
    state.position_m = seam.trial.hips[i];
    renderer.step(stage.at(static_cast<int>(i)), state, state.time, realtime::fixture::kTick, rendering);
    double beyond = seam.concave ? -1 : 1;
    for (const Wall& wall : seam.walls) {
      const double height = wall.normal.dot(rendering.proxy_m) - wall.offset_m;
      beyond = seam.concave ? std::max(beyond, height) : std::min(beyond, height);
    }
    worst = std::max(worst, beyond);
  }
  return worst;
}

class CrackTest : public testing::TestWithParam<SeamCase> {};
INSTANTIATE_TEST_SUITE_P(, CrackTest,
                         testing::Values(SeamCase{"junction_point", Parts::junction, false},
                                         SeamCase{"junction_ball", Parts::junction, true},
                                         SeamCase{"objects_point", Parts::objects, false},
                                         SeamCase{"objects_ball", Parts::objects, true},
                                         SeamCase{"soup_point", Parts::soup, false},
                                         SeamCase{"soup_ball", Parts::soup, true},
                                         SeamCase{"pocket_point", Parts::pocket, false},
                                         SeamCase{"pocket_ball", Parts::pocket, true}),
                         [](const auto& seamCase) { return std::string(seamCase.param.name); });

TEST_P(CrackTest, nothing_passes_a_seam) {
  int through = 0;
  std::string first;
  for (int seed = 1; seed <= seamCount(); ++seed) {
    const Seam seam = makeSeam(GetParam().parts, GetParam().ball, static_cast<std::uint64_t>(seed));
    const double beyond = farthestBeyond(seam);
    if (!(beyond > kMargin_m)) continue;
    if (++through > 1) continue;
    first = "seed " + std::to_string(seed) + ", gap " + std::to_string(seam.gap * 1e6) + " um, bend " +
            std::to_string(seam.bend) + " rad, " + std::to_string(beyond * 1e3) + " mm beyond";
  }
  EXPECT_EQ(through, 0) << "of " << seamCount() << "; first: " << first;
}

// Vertices 200 m from the origin of their object, as of a building in its surveyor's coordinates: floats are
// 15 um apart there, and the plates meet at the device's origin.
TEST(CoarseFloatsTest, nothing_passes_a_seam_of_coarse_floats) {
  constexpr double kSpacing_m = 0x1p-16;
  int through = 0;
  for (int seed = 1; seed <= seamCount() / 5; ++seed) {
    Dice dice(static_cast<std::uint64_t>(seed));
    Seam seam;
    seam.bend = dice.uniform(0.1, 1.4);
    const Point along(0, 2 * kHalf_m, 0);
    const Point right = kHalf_m * Point(std::cos(seam.bend), 0, std::sin(seam.bend));
    Shape both = patch({-kHalf_m, -kHalf_m, 0}, {kHalf_m, 0, 0}, along, 2, dice.integer(1, 7), 0.3, dice);
    both.append(patch({0, -kHalf_m, 0}, right, along, 2, dice.integer(1, 7), 0.3, dice));
    seam.walls = {{-Point::UnitZ(), 0}, {Point(std::sin(seam.bend), 0, -std::cos(seam.bend)), 0}};
    seam.bottom = (seam.walls[0].normal + seam.walls[1].normal).normalized();
    Pose pose;
    pose.position_m = 200 * dice.direction();
    pose.rotation = dice.rotation();
    seam.trial.objects.push_back(bake(both, pose));
    seam.trial.objects.back().material.stiffness_N_per_m = 1000;
    makeHand(seam, Parts::junction, dice);
    if (farthestBeyond(seam) > 2 * 4 * kSpacing_m) ++through;
  }
  EXPECT_EQ(through, 0);
}

// A hole in a plate: a slit, or a square of four plates around it.
Trial plateWithHole(double width, bool square, Dice& dice) {
  const double inner = 0.5 * width;
  Trial trial;
  Shape all;
  const auto add = [&](double x0, double x1, double y0, double y1) {
    all.append(patch({x0, y0, 0}, {x1 - x0, 0, 0}, {0, y1 - y0, 0}, 1, dice.integer(1, 4), 0.3, dice));
  };
  add(-kHalf_m, -inner, -kHalf_m, kHalf_m);
  add(inner, kHalf_m, -kHalf_m, kHalf_m);
  if (square) {
    add(-inner, inner, -kHalf_m, -inner);
    add(-inner, inner, inner, kHalf_m);
  }
  Pose pose;
  pose.rotation = dice.rotation();
  trial.objects.push_back(bake(all, pose));
  return trial;
}

TEST(HoleTest, a_point_enters_holes_wider_than_the_tolerance) {
  Dice dice(5);
  for (const double width : {12e-6, 15e-6, 20e-6, 50e-6, 200e-6, 1e-3}) {
    for (const bool square : {false, true}) {
      for (int i = 0; i < 20; ++i) {
        Trial trial = plateWithHole(width, square, dice);
        const Point beside = square ? Point(Point::Zero()) : Point(0, dice.uniform(-0.01, 0.01), 0);
        for (int k = 0; k <= 40; ++k) trial.hips.push_back(beside + Point(0, 0, 0.002 - 1e-4 * k));
        Stage stage(trial);
        realtime::Renderer renderer;
        realtime::Rendering rendering;
        for (std::size_t k = 0; k < trial.hips.size(); ++k) {
          device::DeviceState state;
          state.time = static_cast<base::Nanos>(k) * realtime::fixture::kTick;
          state.position_m = trial.hips[k];
          renderer.step(stage.at(static_cast<int>(k)), state, state.time, realtime::fixture::kTick,
                        rendering);
        }
        EXPECT_LT(rendering.proxy_m.z(), -0.0019) << width * 1e6 << " um, square " << square;
        EXPECT_EQ(rendering.force_N.norm(), 0);
      }
    }
  }
}

// Two walls of an acute wedge that end before they meet: the gap between them is 6 um wide, and their planes
// meet behind it. A point rests on the walls in front of the gap; without a gap, where they meet.
TEST(WedgeTest, the_reported_place_is_in_front_of_the_gap) {
  constexpr double kHalfAngle = 0.26;
  for (const double end : {0.0, 12e-6}) {
    Dice dice(3);
    Trial trial;
    for (const double side : {-1.0, 1.0}) {
      const Point up(side * std::sin(kHalfAngle), 0, std::cos(kHalfAngle));
      const Point along(0, side * 2 * kHalf_m, 0);
      trial.objects.push_back(
          bake(patch(end * up - 0.5 * along, kHalf_m * up, along, 2, 3, 0, dice), Pose{}));
    }
    for (int k = 0; k <= 40; ++k) trial.hips.emplace_back(0, 0, 0.002 - 1e-4 * k);
    Stage stage(trial);
    realtime::Renderer renderer;
    realtime::Rendering rendering;
    for (std::size_t k = 0; k < trial.hips.size(); ++k) {
      device::DeviceState state;
      state.time = static_cast<base::Nanos>(k) * realtime::fixture::kTick;
      state.position_m = trial.hips[k];
      renderer.step(stage.at(static_cast<int>(k)), state, state.time, realtime::fixture::kTick, rendering);
    }
    EXPECT_TRUE(rendering.touching);
    const double gap = end * std::cos(kHalfAngle);
    EXPECT_GT(rendering.proxy_m.z(), gap - 2e-6);
    EXPECT_LT(rendering.proxy_m.z(), gap + 1e-6);
  }
}

}  // namespace
}  // namespace hapticd::truth

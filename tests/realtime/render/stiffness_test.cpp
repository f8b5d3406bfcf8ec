// Surfaces of unequal stiffness near each other: one potential, each surface's own stiffness alone, and never
// more than the stiffest spring. The expected numbers follow from energies and from formulas given here.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "geometry/rotation.h"
#include "meshes.h"
#include "reduced.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

class StiffnessTest : public testing::Test {
 protected:
  std::mt19937 random{11};
  SceneFixture scene;

  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); }
  // Evenly in the logarithm: contrasts up to 40.
  double stiffness() { return 50 * std::exp(uniform(0, std::log(40.0))); }

  // A plate from the line through `edge` along +-y, `length` wide in the direction `out`, felt from `normal`.
  scene::ObjectState& addPlate(const Vec3& edge, const Vec3& out, const Vec3& normal, double k,
                               double length = 0.04, double mu = 0) {
    TriangleMesh mesh;
    const Vec3 y = 0.05 * Vec3::UnitY();
    for (const Vec3& v :
         {Vec3(edge - y), Vec3(edge + y), Vec3(edge + length * out + y), Vec3(edge + length * out - y)}) {
      mesh.vertices.push_back(v.cast<float>());
    }
    const bool turned = y.cross(out).dot(normal) < 0;
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    if (turned) mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
    return scene.add(mesh, surface(k, mu, mu));
  }
  // A groove along y with its crease at the origin, `angle` between its walls, open upwards.
  void addGroove(double angle, double left, double right, double mu = 0) {
    const double c = std::cos(angle / 2);
    const double s = std::sin(angle / 2);
    addPlate(Vec3::Zero(), Vec3(-s, 0, c), Vec3(c, 0, s), left, 0.04, mu);
    addPlate(Vec3::Zero(), Vec3(s, 0, c), Vec3(-c, 0, s), right, 0.04, mu);
  }
  void addPlane(const Vec3& normal, double height, double k) {
    scene::Plane plane;
    plane.index = static_cast<std::int32_t>(scene.planes.size());
    plane.normal = normal;
    plane.offset = -height;
    plane.surface = surface(k);
    scene.planes.push_back(plane);
  }
};

// A smooth closed path.
class ClosedPath {
 public:
  template <class Random>
  ClosedPath(const Vec3& centre, double size, Random&& uniform) : centre_(centre) {
    for (int k = 0; k < 3; ++k) {
      for (Vec3* v : {&cosine_[k], &sine_[k]}) {
        *v = size / (k + 1) * Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      }
    }
  }
  Vec3 at(double share) const {
    Vec3 p = centre_;
    for (int k = 0; k < 3; ++k) {
      const double a = 2 * M_PI * (k + 1) * share;
      p += std::cos(a) * cosine_[k] + std::sin(a) * sine_[k];
    }
    return p;
  }

 private:
  Vec3 centre_;
  Vec3 cosine_[3];
  Vec3 sine_[3];
};

struct Turn {
  double work = 0;          // done on the hand
  double proxyMoved = 0;    // from the start of the turn to its end
  double largestRatio = 0;  // |F| / depth
  double largestStep = 0;
  double touching = 0;  // share of the ticks
};

constexpr int kSteps = reduced(100'000);
constexpr int kParts = reduced(1'000);
// Error of the trapezoidal rule: it grows with the length of a step, and with that of a part of one.
constexpr double kQuadrature_J = kSteps < 100'000 ? 1e-7 : 1e-9;

// One turn of the hand, with the trapezoidal rule. A third unequal surface gives the potential a kink where
// an edge is reached: ticks with `fine` are divided into kParts, so that a step of the force costs no
// accuracy.
template <class Path>
Turn turn(Hand& hand, const Path& path, int steps, const std::vector<bool>& fine = {}) {
  Turn t;
  Vec3 last = path(0.0);
  hand.at(last);
  Vec3 lastForce = hand.now().force_N;
  const Vec3 proxy = hand.now().proxy_m;
  for (int i = 1; i <= steps; ++i) {
    const int parts = !fine.empty() && fine[static_cast<std::size_t>(i)] ? kParts : 1;
    for (int k = 1; k <= parts; ++k) {
      const Vec3 p =
          i == steps && k == parts ? path(0.0) : path((i - 1 + static_cast<double>(k) / parts) / steps);
      const Rendering& r = hand.at(p);
      t.work += 0.5 * (r.force_N + lastForce).dot(p - last);
      t.largestStep = std::max(t.largestStep, (r.force_N - lastForce).norm());
      if (r.depth_m > 0) t.largestRatio = std::max(t.largestRatio, r.force_N.norm() / r.depth_m);
      t.touching += r.touching ? 1.0 / steps / parts : 0;
      last = p;
      lastForce = r.force_N;
    }
  }
  t.proxyMoved = (hand.now().proxy_m - proxy).norm();
  return t;
}

// The ticks of a turn in which the force steps.
template <class Path>
std::vector<bool> stepsOf(Hand& hand, const Path& path, int steps, double stiffest) {
  std::vector<bool> fine(static_cast<std::size_t>(steps) + 1);
  Vec3 last = path(0.0);
  Vec3 lastForce = hand.at(last).force_N;
  for (int i = 1; i <= steps; ++i) {
    const Vec3 p = path(static_cast<double>(i % steps) / steps);
    const Vec3 force = hand.at(p).force_N;
    fine[static_cast<std::size_t>(i)] = (force - lastForce).norm() > 5 * stiffest * (p - last).norm();
    last = p;
    lastForce = force;
  }
  return fine;
}

// The review's groove: circles of 1 mm, 3 mm below the crease. A sum of K_i d_i n_i gave 4.9 and 10.6 mJ.
TEST_F(StiffnessTest, unequal_groove_gives_no_energy) {
  for (const double degrees : {90.0, 60.0, 30.0, 15.0}) {
    scene = SceneFixture();
    addGroove(degrees * M_PI / 180, 1000, 100);
    Hand hand(scene.snapshot());
    hand.at({0, 0, 0.01});
    hand.to({0, 0, -0.003});
    for (const double way : {1.0, -1.0}) {
      const auto circle = [&](double share) {
        const double a = way * 2 * M_PI * share;
        return Vec3(0.001 * std::sin(a), 0, -0.003 + 0.001 * (1 - std::cos(a)));
      };
      const Turn t = turn(hand, circle, kSteps);
      EXPECT_NEAR(t.work, 0, 1e-9) << degrees;
      EXPECT_LT(t.proxyMoved, 1e-8);
      EXPECT_LE(t.largestRatio, 1000 * (1 + 1e-9)) << degrees;
    }
  }
}

TEST_F(StiffnessTest, force_in_a_narrow_groove_is_at_most_that_of_the_stiffer_wall) {
  addGroove(15 * M_PI / 180, 1000, 100);
  Hand hand(scene.snapshot());
  hand.at({0, 0, 0.02});
  hand.to({0, 0, 0});
  hand.to({0, 0, -0.004}, 0.01,
          [&](const Rendering& r) { EXPECT_LE(r.force_N.norm(), 1000 * r.depth_m * (1 + 1e-9) + 1e-9); });
  EXPECT_NEAR(hand.now().depth_m, 0.004, 1e-6);
  EXPECT_LE(hand.now().force_N.norm(), 4.0 * (1 + 1e-9));
}

// Pairs and triples of planes at random: the path passes faces, edges, corners and free space.
TEST_F(StiffnessTest, closed_paths_over_random_planes_do_no_work) {
  double worst = 0;
  for (int i = 0; i < reduced(12, 2); ++i) {
    scene = SceneFixture();
    double stiffest = 0;
    for (int k = 0; k < 2 + i % 2; ++k) {
      const Vec3 n = Vec3(uniform(-1, 1), uniform(-1, 1), uniform(0.2, 1)).normalized();
      const double stiff = stiffness();
      stiffest = std::max(stiffest, stiff);
      addPlane(n, uniform(-5e-4, 5e-4), stiff);
    }
    Hand hand(scene.snapshot());
    hand.at({0, 0, 0.02});
    const ClosedPath loop({uniform(-1e-3, 1e-3), uniform(-1e-3, 1e-3), uniform(-3e-3, 0)}, 1.2e-3,
                          [this](double a, double b) { return uniform(a, b); });
    hand.to(loop.at(0));
    const auto path = [&](double share) { return loop.at(share); };
    turn(hand, path, 2000);
    const std::vector<bool> fine = stepsOf(hand, path, kSteps, stiffest);
    EXPECT_LT(std::count(fine.begin(), fine.end(), true), 30) << "scene " << i;
    const Turn t = turn(hand, path, kSteps, fine);
    EXPECT_LE(std::abs(t.work), kQuadrature_J) << "scene " << i;
    EXPECT_LT(t.proxyMoved, 1e-8) << "scene " << i;
    EXPECT_LE(t.largestRatio, stiffest * (1 + 1e-9)) << "scene " << i;
    EXPECT_GT(t.touching, 0.3);
    worst = std::max(worst, std::abs(t.work));
  }
  std::printf("largest |work| %.3g J\n", worst);
}

// The same with plates that pass through each other, in transforms of their own.
TEST_F(StiffnessTest, closed_paths_over_random_plates_do_no_work) {
  double worst = 0;
  for (int i = 0; i < reduced(6, 2); ++i) {
    scene = SceneFixture();
    double stiffest = 0;
    for (int k = 0; k < 2 + i % 2; ++k) {
      const Vec3 n = Vec3(uniform(-0.7, 0.7), uniform(-0.7, 0.7), 1).normalized();
      const double stiff = stiffness();
      stiffest = std::max(stiffest, stiff);
      Affine placed(geometry::rotationBetween(Vec3::UnitZ(), n));
      placed.pretranslate(uniform(-5e-4, 5e-4) * n);
      scene.add(plane(0.05, 7), surface(stiff), placed);
    }
    Hand hand(scene.snapshot());
    hand.at({0, 0, 0.02});
    const ClosedPath loop({uniform(-1e-3, 1e-3), uniform(-1e-3, 1e-3), uniform(-3e-3, 0)}, 1.2e-3,
                          [this](double a, double b) { return uniform(a, b); });
    hand.to(loop.at(0));
    const auto path = [&](double share) { return loop.at(share); };
    turn(hand, path, 2000);
    const std::vector<bool> fine = stepsOf(hand, path, kSteps, stiffest);
    EXPECT_LT(std::count(fine.begin(), fine.end(), true), 30) << "scene " << i;
    const Turn t = turn(hand, path, kSteps, fine);
    EXPECT_LE(std::abs(t.work), kQuadrature_J) << "scene " << i;
    EXPECT_LT(t.proxyMoved, 1e-8) << "scene " << i;
    EXPECT_LE(t.largestRatio, stiffest * (1 + 1e-9)) << "scene " << i;
    worst = std::max(worst, std::abs(t.work));
  }
  std::printf("largest |work| %.3g J\n", worst);
}

// A convex edge takes energy, as with equal surfaces, and gives none: also from soft to stiff.
TEST_F(StiffnessTest, convex_edges_give_no_energy) {
  for (int i = 0; i < reduced(20, 2); ++i) {
    scene = SceneFixture();
    const double angle = uniform(0.01, 1.2);
    addPlate(Vec3::Zero(), -Vec3::UnitX(), Vec3::UnitZ(), stiffness());
    addPlate(Vec3::Zero(), Vec3(std::cos(angle), 0, -std::sin(angle)),
             Vec3(std::sin(angle), 0, std::cos(angle)), stiffness());
    Hand hand(scene.snapshot());
    hand.at({0, 0, 0.02});
    const ClosedPath loop({uniform(-2e-3, 2e-3), 0, uniform(-3e-3, -1e-3)}, 2e-3,
                          [this](double a, double b) { return uniform(a, b); });
    hand.to(loop.at(0));
    turn(
        hand, [&](double s) { return loop.at(s); }, 2000);
    EXPECT_LE(turn(
                  hand, [&](double s) { return loop.at(s); }, 20'000)
                  .work,
              1e-8)
        << "angle " << angle;
  }
}

// K 100 | K 1000 at 2 mm depth: the way there costs the difference of the energies, the way back returns it.
// The force along the seam follows from K(x), and is what 1/2 (K2 - K1) d^2 over a length of 2 w needs.
TEST_F(StiffnessTest, flat_seam_costs_its_energy) {
  constexpr double kDepth = 0.002;
  const double width = std::hypot(0.001, 1.75 * kDepth);
  addPlate(Vec3::Zero(), -Vec3::UnitX(), Vec3::UnitZ(), 100);
  addPlate(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ(), 1000);
  Hand hand(scene.snapshot());
  hand.at({-0.01, 0.0003, 0.001});
  hand.to({-0.01, 0.0003, -kDepth});
  EXPECT_EQ(hand.now().force_N.z(), 100 * kDepth);
  double there = 0;
  double largest = 0;
  double step = 0;
  Vec3 last = hand.hip();
  Vec3 lastForce = hand.now().force_N;
  const auto measure = [&](double& work) {
    return [&](const Rendering& r) {
      const double t = std::min(1.0, std::abs(hand.hip().x()) / width);
      EXPECT_NEAR(-r.force_N.x(), 0.5 * 900 * kDepth * kDepth / width * 1.5 * 2 * t * (1 - t), 1e-5);
      work += 0.5 * (r.force_N + lastForce).dot(hand.hip() - last);
      step = std::max(step, (r.force_N - lastForce).norm());
      largest = std::max(largest, std::abs(r.force_N.x()));
      last = hand.hip();
      lastForce = r.force_N;
    };
  };
  hand.to({0.01, 0.0003, -kDepth}, 0.01, measure(there));
  EXPECT_NEAR(hand.now().force_N.z(), 1000 * kDepth, 1e-9);
  EXPECT_NEAR(there, -0.5 * 900 * kDepth * kDepth, 1e-7);
  double back = 0;
  hand.to({-0.01, 0.0003, -kDepth}, 0.01, measure(back));
  EXPECT_NEAR(there + back, 0, 1e-9);
  EXPECT_LT(step, 0.01);  // 1.8 N without a width
  std::printf("largest tangential force %.3f N\n", largest);
}

// A surface keeps its stiffness, to the bit, where no other one is within the width; a floor below a sheet
// and the hidden side of a crossing plate are not there to be felt.
TEST_F(StiffnessTest, surface_touched_alone_keeps_its_stiffness) {
  scene.add(plane(0.02, 5), surface(200));
  TriangleMesh floor = plane(0.02, 5);
  geometry::scaleAndMove(floor, 1, Vec3(0, 0, -0.002));
  scene.add(floor, surface(2000));
  TriangleMesh beside = plane(0.01, 5);
  geometry::scaleAndMove(beside, 1, Vec3(0.04, 0, 0));
  scene.add(beside, surface(900));
  Hand hand(scene.snapshot());
  hand.at({0.001, 0.002, 0.001});
  for (int i = 1; i <= 40; ++i) {
    const double depth = i * 1e-4;
    const Rendering& r = hand.to({0.001, 0.002, -depth});
    EXPECT_EQ(r.force_N, Vec3(0, 0, r.depth_m * 200)) << depth;
  }
}

// Two plates that are one plane, within rounding or 0.0001 rad: as one plate, also beside a third stiffness.
TEST_F(StiffnessTest, nearly_coplanar_faces_act_as_one) {
  for (const double tilt : {0.0, 1e-7, -1e-7, 1e-4, -1e-4}) {
    SceneFixture one;
    const auto other = plane(0.01, 5);
    std::swap(one, scene);
    addPlate({-0.03, 0, 0}, Vec3::UnitX(), Vec3::UnitZ(), 500, 0.03);
    addPlate(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ(), 500, 0.002);
    addPlate({0.002, 0, 0}, Vec3::UnitX(), Vec3::UnitZ(), 1500, 0.02);
    std::swap(one, scene);
    scene = SceneFixture();
    addPlate({-0.03, 0, 0.03 * tilt}, Vec3(1, 0, -tilt).normalized(), Vec3(tilt, 0, 1).normalized(), 500,
             0.03);
    addPlate(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ(), 500, 0.002);
    addPlate({0.002, 0, 0}, Vec3::UnitX(), Vec3::UnitZ(), 1500, 0.02);
    Hand flat(one.snapshot());
    Hand tilted(scene.snapshot());
    for (Hand* hand : {&flat, &tilted}) {
      hand->at({-0.004, 0.0003, 0.001});
      hand->to({-0.004, 0.0003, -0.001});
    }
    for (int i = 0; i <= 500; ++i) {
      const Vec3 p(-0.004 + 1e-5 * i, 0.0003, -0.001);
      const Vec3 f = flat.at(p).force_N;
      EXPECT_NEAR((tilted.at(p).force_N - f).norm(), 0, 1e-4 + 20 * std::abs(tilt))
          << tilt << " at " << p.x();
    }
  }
}

// No more than the stiffest spring, whatever meets: plates, planes, boxes, point and ball.
TEST_F(StiffnessTest, force_never_exceeds_the_stiffest_spring) {
  for (int i = 0; i < reduced(40, 6); ++i) {
    scene = SceneFixture();
    scene.faces = i % 3 == 0 ? scene::TouchableFaces::both : scene::TouchableFaces::front;
    double stiffest = 0;
    const auto any = [&] {
      const double k = stiffness();
      stiffest = std::max(stiffest, k);
      return k;
    };
    for (int k = 0; k < 5; ++k) {
      const Vec3 n = Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized();
      Affine placed(geometry::rotationBetween(Vec3::UnitZ(), n));
      placed.pretranslate(Vec3(uniform(-4e-3, 4e-3), uniform(-4e-3, 4e-3), uniform(-4e-3, 4e-3)));
      if (k % 2 == 0) {
        scene.add(box(Vec3::Constant(-0.003), Vec3::Constant(0.003)), surface(any()), placed);
      } else {
        scene.add(plane(0.006, 5), surface(any()), placed);
      }
    }
    if (i % 2 == 0) addPlane(Vec3(0.1, 0.2, 1).normalized(), -0.004, any());
    RenderOptions options;
    options.toolRadius_m = i % 4 == 3 ? 0.001 : 0;
    Hand hand(scene.snapshot(), options);
    hand.at({0, 0, 0.02});
    for (int k = 0; k < 12; ++k) {
      hand.to({uniform(-6e-3, 6e-3), uniform(-6e-3, 6e-3), uniform(-6e-3, 6e-3)}, 0.05,
              [&](const Rendering& r) {
                EXPECT_LE(r.force_N.norm(), stiffest * r.depth_m * (1 + 1e-9) + 1e-12) << "scene " << i;
              });
    }
  }
}

// Fifteen soft plates in one place have fifteen times the weight of one, and so a steep slope.
TEST_F(StiffnessTest, several_soft_neighbours_do_not_add_up) {
  constexpr double kStiff = 1000;
  addPlate(Vec3::Zero(), -Vec3::UnitX(), Vec3::UnitZ(), kStiff);
  for (int i = 0; i < 15; ++i) addPlate(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ(), 10 + i);
  Hand hand(scene.snapshot());
  hand.at({-0.01, 0, 0.001});
  double largest = 0;
  for (double x = -0.01; x < 0.002; x += 2e-5) {
    const Rendering& r = hand.at({x, 0, -0.002});
    largest = std::max(largest, r.force_N.norm() / r.depth_m);
    EXPECT_LE(r.force_N.norm(), kStiff * r.depth_m * (1 + 1e-9)) << x;
  }
  EXPECT_GT(largest, 0.99 * kStiff);
}

// Fifteen stiff plates in one place beside a soft one: the blend stores its energy along so short a way that
// it would push with 1.6 times what the stiffest of them alone does.
TEST_F(StiffnessTest, several_stiff_neighbours_do_not_add_up) {
  constexpr double kStiffest = 1000;
  addPlate(Vec3::Zero(), -Vec3::UnitX(), Vec3::UnitZ(), 20);
  for (int i = 0; i < 15; ++i) addPlate(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ(), kStiffest - i);
  Hand hand(scene.snapshot());
  hand.at({-0.01, 0, 0.001});
  double largestBeside = 0;
  for (double x = -0.01; x < 0.002; x += 2e-5) {
    const Rendering& r = hand.at({x, 0, -0.002});
    EXPECT_EQ(r.status, 0U) << x;
    EXPECT_LE(r.force_N.norm(), kStiffest * r.depth_m * (1 + 1e-9)) << x;
    if (x < -0.001) largestBeside = std::max(largestBeside, r.force_N.norm() / r.depth_m);
  }
  EXPECT_GT(largestBeside, 0.99 * kStiffest) << "nothing was limited";
}

// What is near takes part in a deep spring from farther away than the tick looks for contact.
TEST_F(StiffnessTest, a_neighbour_that_a_command_changes_is_told_as_far_as_it_takes_part) {
  constexpr double kTold_N = 0.1;
  int steps = 0;
  for (double beside = 0.001; beside < 0.036; beside += 0.001) {
    scene = SceneFixture();
    addPlane(Vec3::UnitZ(), 0, 1000);
    scene::ObjectState& other = addPlate(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ(), 1000);
    scene::ObjectState& far = addPlate({0.1, 0, 0}, Vec3::UnitX(), Vec3::UnitZ(), 1000);
    addPlate({0.2, 0, 0}, Vec3::UnitX(), Vec3::UnitZ(), 1000);
    Hand hand(scene.snapshot());
    hand.at({-beside, 0, 0.001});
    for (int i = 1; i <= 40; ++i) hand.at({-beside, 0, -0.0005 * i});
    far.surface = surface(100);
    hand.show(scene.snapshot());
    EXPECT_EQ(hand.at({-beside, 0, -0.020}).status, 0U) << beside;
    const Vec3 before = hand.now().force_N;
    other.surface = surface(100);
    hand.show(scene.snapshot());
    const Rendering& r = hand.at({-beside, 0, -0.020});
    const double step_N = (r.force_N - before).norm();
    if (std::abs(step_N - kTold_N) < 0.1 * kTold_N) continue;
    EXPECT_EQ(r.status, step_N > kTold_N ? kRenderGeometryJump : 0U) << beside << " " << step_N;
    steps += step_N > kTold_N ? 1 : 0;
  }
  EXPECT_GT(steps, 20);
}

// Millimetres and other transforms of the same scene give the same force.
TEST_F(StiffnessTest, blend_does_not_depend_on_the_unit) {
  std::array<Vec3, 2> force;
  for (std::size_t k = 0; k < 2; ++k) {
    scene = SceneFixture();
    const double units = k == 0 ? 1 : 1000;
    scene.setWorldUnitsPerMetre(units);
    for (const double side : {-1.0, 1.0}) {
      Affine placed{Eigen::UniformScaling<double>(units)};
      placed.translate(Vec3(side * 0.02, 0, 0));
      scene.add(plane(0.02, 8), surface(side < 0 ? 300 : 1200), placed);
    }
    Hand hand(scene.snapshot());
    hand.at({0.0007, 0.0003, 0.001});
    force[k] = hand.to({0.0007, 0.0003, -0.001}).force_N;
  }
  EXPECT_NEAR((force[1] - force[0]).norm(), 0, 1e-6);
  EXPECT_LT(force[0].x(), -0.01);
}

// What lies below the touched face counts as if it were six times as far away, and with the potential
// 1/2 kappa d^2 the force grows as kappa does with the width.
TEST_F(StiffnessTest, hidden_surface_counts_by_six_times_its_depth) {
  constexpr double kTouched = 900;
  constexpr double kHidden = 300;
  constexpr double kBelow_m = 0.2e-3;
  addPlate({-0.02, 0, 0}, Vec3::UnitX(), Vec3::UnitZ(), kTouched);
  addPlate({-0.02, 0, -kBelow_m}, Vec3::UnitX(), Vec3::UnitZ(), kHidden);
  const auto potential = [&](double depth_m) {
    const double t = std::min(1.0, 6 * kBelow_m / std::hypot(1e-3, 1.75 * depth_m));
    const double s = 0.5 * (1 - t * t * (3 - 2 * t));
    return 0.5 * (kTouched + (kHidden - kTouched) * s) * depth_m * depth_m;
  };
  const auto snapshot = scene.snapshot();
  Renderer renderer;
  device::DeviceState hand;
  Rendering out;
  Nanos now = 0;
  for (double depth_m = -0.0005; depth_m < 0.002; depth_m += 0.01e-3) {
    hand.position_m = {0, 0.001, -depth_m};
    renderer.step(*snapshot, hand, now += kTick, kTick, out);
    if (depth_m < 0.1e-3) continue;
    const double force_N = (potential(depth_m + 1e-7) - potential(depth_m - 1e-7)) / 2e-7;
    ASSERT_NEAR(out.force_N.z(), force_N, 2e-3 * force_N) << depth_m;
  }
}

// A mesh that moved has another tree than a copy that did not, with more room around its triangles.
std::shared_ptr<scene::MeshGeometry> geometryWithRoom(const TriangleMesh& mesh, std::uint64_t topology,
                                                      std::mt19937& random) {
  auto geometry = geometryOf(mesh, topology);
  std::uniform_real_distribution<double> room(0, 1e-3);
  std::vector<Box> boxes;
  for (const geometry::Triangle& t : mesh.triangles) {
    Box box;
    for (const std::uint32_t v : t) box.extend(Vec3(mesh.vertices[v].cast<double>()));
    boxes.push_back({box.min - Vec3::Constant(room(random)), box.max + Vec3::Constant(room(random))});
  }
  geometry->index = scene::SpatialIndex::build(static_cast<std::uint32_t>(boxes.size()),
                                               [&boxes](std::uint32_t id) { return boxes[id]; });
  return geometry;
}

TEST_F(StiffnessTest, blend_does_not_depend_on_the_tree) {
  constexpr int kCells = 60;
  constexpr double kCell_m = 0.25e-3;
  // A rough wall beside the plate, and a floor below it that the plate hides.
  TriangleMesh mesh;
  const auto addSheet = [&](const Vec3& corner, const Vec3& u, const Vec3& v, double rough_m) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int i = 0; i <= kCells; ++i) {
      for (int k = 0; k <= kCells; ++k) {
        const Vec3 at = corner + kCell_m * (i * u + k * v) + uniform(-rough_m, rough_m) * u.cross(v);
        mesh.vertices.push_back(at.cast<float>());
        if (i == kCells || k == kCells) continue;
        const std::uint32_t a = first + static_cast<std::uint32_t>(i * (kCells + 1) + k);
        mesh.triangles.push_back({a, a + kCells + 1, a + kCells + 2});
        mesh.triangles.push_back({a, a + kCells + 2, a + 1});
      }
    }
  };
  addSheet({0.002, -0.0075, -0.0075}, Vec3::UnitY(), Vec3::UnitZ(), 0.1e-3);
  addSheet({-0.0075, -0.0075, -0.0006}, Vec3::UnitX(), Vec3::UnitY(), 0);
  scene.faces = scene::TouchableFaces::both;
  SceneFixture other;
  other.faces = scene.faces;
  addPlate({-0.02, 0, 0}, Vec3::UnitX(), Vec3::UnitZ(), 900);
  other.add(geometryOf({{{-0.02F, -0.05F, 0}, {-0.02F, 0.05F, 0}, {0.02F, 0.05F, 0}, {0.02F, -0.05F, 0}},
                        {{0, 2, 1}, {0, 3, 2}}},
                       1),
            surface(900), scene::Motion::fixed(Affine::Identity()));
  scene.add(geometryOf(mesh, 2), surface(300), scene::Motion::fixed(Affine::Identity()));
  other.add(geometryWithRoom(mesh, 2, random), surface(300), scene::Motion::fixed(Affine::Identity()));
  const auto one = scene.snapshot();
  const auto two = other.snapshot();
  Renderer first, second;
  device::DeviceState hand;
  Rendering a, b;
  int blended = 0;
  for (int i = 0; i < 1500; ++i) {
    const double t = i * 1e-3;
    hand.position_m = {0.0012 * std::sin(7 * t), 0.004 * std::sin(5 * t), 0.0005 - std::min(t, 0.5) * 0.004};
    first.step(*one, hand, i * kTick, kTick, a);
    second.step(*two, hand, i * kTick, kTick, b);
    ASSERT_EQ(a.force_N, b.force_N) << "tick " << i << ", status " << a.status << " " << b.status;
    ASSERT_EQ(a.proxy_m, b.proxy_m) << "tick " << i;
    blended += a.touching && std::abs(a.force_N.x()) > 1e-6 ? 1 : 0;
  }
  EXPECT_GT(blended, 500);
}

// With friction the slope of the stiffness is held by the proxy, and a cycle gives no energy either.
TEST_F(StiffnessTest, friction_on_a_seam_gives_no_energy) {
  for (const double mu : {0.02, 0.1, 0.5}) {
    scene = SceneFixture();
    addPlate(Vec3::Zero(), -Vec3::UnitX(), Vec3::UnitZ(), 100, 0.04, mu);
    addPlate(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitZ(), 1000, 0.04, mu);
    for (int i = 0; i < reduced(6, 2); ++i) {
      Hand hand(scene.snapshot());
      hand.at({0, 0, 0.01});
      const ClosedPath loop({uniform(-1e-3, 1e-3), 0, -2e-3}, i % 2 == 0 ? 2e-3 : 3e-4,
                            [this](double a, double b) { return uniform(a, b); });
      hand.to(loop.at(0));
      for (int k = 0; k < 2; ++k)
        turn(
            hand, [&](double s) { return loop.at(s); }, reduced(20'000));
      EXPECT_LE(turn(
                    hand, [&](double s) { return loop.at(s); }, reduced(20'000))
                    .work,
                1e-8)
          << mu << " " << i;
    }
  }
}

// Where a slide meets the second wall of a groove, the direction of the spring turns, and with it what the
// walls hide of a third surface: the spring stores more. The wall holds the hand all the same.
TEST_F(StiffnessTest, slide_with_friction_is_held_by_the_wall_that_it_meets) {
  constexpr double kHalf = 0.5;  // of the angle between the walls
  constexpr int ticks = 60;
  const Vec3 left(std::cos(kHalf), 0, std::sin(kHalf));
  const Vec3 right(-std::cos(kHalf), 0, std::sin(kHalf));
  const Vec3 up(-std::sin(kHalf), 0, std::cos(kHalf));
  for (const double hard : {400.0, 1140.0, 2000.0}) {
    scene = SceneFixture();
    addPlate(Vec3::Zero(), up, left, 1100, 0.04, 0.6);
    addPlate(Vec3::Zero(), Vec3(std::sin(kHalf), 0, std::cos(kHalf)), right, hard, 0.04, 0.05);
    addPlate(-0.0005 * left, up, left, 3400, 0.04, 0.5);
    Hand hand(scene.snapshot());
    hand.at(0.004 * up + 0.002 * left);
    hand.to(0.004 * up - 0.0015 * left);
    const Vec3 way = -0.01 * up + 0.0015 * left;
    for (int k = 0; k < ticks; ++k) {
      const Vec3 force = hand.at(hand.hip() + way / ticks).force_N;
      const double depth = -right.dot(hand.hip());
      if (depth > 0.0005) {
        ASSERT_GE(force.dot(right), 0.5 * hard * depth) << hard << " " << k;
      }
    }
  }
}

// A dome beside a block of another stiffness: on round meshes the slope of the stiffness changes from face to
// face. The hand sinks into the dome and rests.
class UnequalDomeTest : public StiffnessTest {
 protected:
  struct Place {
    double soft, hard, radius;
    Vec3 above, rest;
  };
  Place anyPlace() {
    const double hard = uniform(100, 500);
    const Vec3 p(uniform(0.003, 0.008), uniform(-0.004, 0.004), 0);
    Place place{std::max(25.0, hard / uniform(2, 10)), hard, uniform(0, 1) < 0.5 ? 0 : 0.002, p, p};
    place.above.z() = 0.024;
    place.rest.z() = std::sqrt(4e-4 - p.squaredNorm()) - uniform(0.001, 0.004);
    return place;
  }
  void build(const Place& place, double mu) {
    scene = SceneFixture();
    scene.add(sphere(0.02, 16), surface(place.soft, mu, mu));
    scene.add(box({0.008, -0.06, -0.03}, {0.06, 0.06, 0.017}), surface(place.hard, mu, mu));
  }
  // At rest, the largest difference from the force after 50 ticks.
  double unrestAt(const Place& place) {
    Hand hand(scene.snapshot(), RenderOptions{.toolRadius_m = place.radius});
    hand.at(place.above);
    hand.to(place.rest, 0.05);
    for (int k = 0; k < 50; ++k) hand.at(place.rest);
    const Vec3 force = hand.now().force_N;
    double farthest = 0;
    for (int k = 0; k < 50; ++k) farthest = std::max(farthest, (hand.at(place.rest).force_N - force).norm());
    return farthest;
  }
  Vec3 forceAt(const Place& place) {
    Hand hand(scene.snapshot(), RenderOptions{.toolRadius_m = place.radius});
    hand.at(place.above);
    return hand.to(place.rest, 0.05).force_N;
  }
};

TEST_F(UnequalDomeTest, hand_at_rest_feels_no_steps_with_little_friction) {
  for (int i = 0; i < reduced(40, 8); ++i) {
    const Place place = anyPlace();
    for (const double mu : {0.02, 0.05, 0.1}) {
      build(place, mu);
      EXPECT_LT(unrestAt(place), 1e-3) << i << " friction " << mu;
    }
  }
}

// Two tries of a slide fill the spring here, and spend more casts than a third would have. It does not stay
// there.
TEST_F(UnequalDomeTest, hand_at_rest_feels_no_steps_where_two_slides_fill_the_spring) {
  for (const Place& place :
       {Place{156, 1456, 0.002, {0.0053605, 0.0030211, 0.024}, {0.0053605, 0.0030211, 0.0179512}},
        Place{332, 1441, 0.002, {0.0042875, 0.0001472, 0.024}, {0.0042875, 0.0001472, 0.0175383}},
        Place{68, 673, 0.002, {0.0035366, -0.0039272, 0.024}, {0.0035366, -0.0039272, 0.0176645}}}) {
    for (const double mu : {0.02, 0.05, 0.1}) {
      build(place, mu);
      EXPECT_LT(unrestAt(place), 1e-3) << place.soft << " friction " << mu;
    }
  }
}

TEST_F(UnequalDomeTest, friction_of_what_is_near_and_not_touched_holds_nothing) {
  for (int i = 0; i < reduced(40, 8); ++i) {
    const Place place = anyPlace();
    build(place, 0);
    const Vec3 alone = forceAt(place);
    scene.add(box({-0.04, -0.04, 0.025}, {0.04, 0.04, 0.03}), surface(place.soft, 0.5, 0.5));
    EXPECT_LT((forceAt(place) - alone).norm(), 1e-3) << i;
  }
}

// Three round organs that overlap, finely meshed: a slide that is tried again takes little of the work of a
// tick, and the force does not fade.
TEST_F(StiffnessTest, slides_beside_each_other_leave_the_work_of_a_tick) {
  constexpr double kBall_m = 0.003;
  for (int i = 0; i < 3; ++i) {
    const double angle = 2 * M_PI * i / 3;
    TriangleMesh organ = sphere(0.009, 64);
    geometry::scaleAndMove(organ, 1, 0.007 * Vec3(std::cos(angle), std::sin(angle), 0));
    scene.add(organ, surface(i == 0 ? 75 : i == 1 ? 450 : 200, 0.1, 0.08));
  }
  Hand hand(scene.snapshot(), RenderOptions{.toolRadius_m = kBall_m});
  for (int k = 0; k < reduced(6000, 1500); ++k) {
    const double t = 1e-3 * k;
    const double above = 0.012 * std::max(0.0, 1 - t);
    const Rendering& r = hand.at({0.008 * std::sin(1.1 * t), 0.008 * std::cos(1.7 * t),
                                  0.004 + kBall_m + above + 0.002 * std::sin(2.3 * t)});
    ASSERT_EQ(r.status & (kRenderWorkLimit | kRenderIterationLimit), 0U) << k;
    if (r.depth_m > 0.002) {
      ASSERT_GT(r.force_N.norm(), 0.02) << k;
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture

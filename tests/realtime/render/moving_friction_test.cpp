// Friction on several surfaces of which some move. The truth is Coulomb's law for a hand whose spring is in
// balance: the normal forces from the depths below the planes, and along the groove the sum of mu_i N_i, each
// against the slip over its own surface.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "meshes.h"
#include "reduced.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

constexpr double kWallStiffness = 1000;
constexpr double kLength_m = 2;
constexpr double kWidth_m = 0.05;
constexpr int kPose = 16;  // ticks of one pose of a stream

// A point tool and a ball.
class MovingFrictionTest : public testing::TestWithParam<double> {
 protected:
  double radius() const { return GetParam(); }
  // The bottom of a groove of two walls at 45 degrees, for the centre of the tool.
  double bottom() const { return radius() * std::numbers::sqrt2; }
  RenderOptions options() const {
    RenderOptions o;
    o.toolRadius_m = radius();
    return o;
  }
};
INSTANTIATE_TEST_SUITE_P(, MovingFrictionTest, testing::Values(0.0, 0.002),
                         [](const auto& tool) { return tool.param > 0 ? "ball" : "point"; });

Affine shifted(const Vec3& by) {
  return Affine(Eigen::Translation3d(by));
}

TriangleMesh quad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  TriangleMesh mesh;
  for (const Vec3& v : {a, b, c, d}) mesh.vertices.push_back(v.cast<float>());
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

// The walls of a groove along x, at `angle` from the floor; the front sides face each other.
TriangleMesh leftWall(double angle) {
  const Vec3 up = kWidth_m * Vec3(0, -std::cos(angle), std::sin(angle));
  const Vec3 end(kLength_m, 0, 0);
  return quad(-end, -end + up, end + up, end);
}
TriangleMesh rightWall(double angle) {
  const Vec3 up = kWidth_m * Vec3(0, std::cos(angle), std::sin(angle));
  const Vec3 end(kLength_m, 0, 0);
  return quad(-end, end, end + up, -end + up);
}

// A wall across x, front side towards -x, that leans back by `lean`.
TriangleMesh blockFace(double lean) {
  TriangleMesh mesh = quad(Vec3(0, -kWidth_m, -0.02), Vec3(0, -kWidth_m, 0.03), Vec3(0, kWidth_m, 0.03),
                           Vec3(0, kWidth_m, -0.02));
  for (auto& v : mesh.vertices) v = Vec3(v.z() * std::sin(lean), v.y(), v.z() * std::cos(lean)).cast<float>();
  return mesh;
}

// A pose stream as the server makes it: from pose to pose in 16 ticks.
scene::Motion poseAt(int tick, Nanos begin, const std::function<Affine(double)>& pose) {
  const int k = tick / kPose * kPose;
  return scene::Motion::between(pose(k * 1e-3), pose((k + kPose) * 1e-3), begin + k * kTick,
                                begin + (k + kPose) * kTick);
}

// A deforming mesh of a stream: the boxes also cover the way before.
std::shared_ptr<scene::MeshGeometry> deforming(const TriangleMesh& before, const TriangleMesh& mesh,
                                               const TriangleMesh& after, int tick) {
  auto g = geometryOf(mesh, 1, &after.vertices, tick * kTick, (tick + kPose) * kTick);
  g->before = g->vertices;
  g->shape = static_cast<std::uint32_t>(tick / kPose);
  g->recentMove = 0.01;
  g->index =
      scene::SpatialIndex::build(static_cast<std::uint32_t>(mesh.triangles.size()), [&](std::uint32_t id) {
        Box box;
        for (const std::uint32_t v : mesh.triangles[id]) {
          for (const TriangleMesh* m : {&before, &mesh, &after})
            box.extend(Vec3(m->vertices[v].cast<double>()));
        }
        return box;
      });
  return g;
}

// Normal forces of two planes through the x axis with normals a and b on a tool at `hip`.
std::pair<double, double> normalForces(const Vec3& a, const Vec3& b, double radius, const Vec3& hip) {
  const double c = a.dot(b);
  const double depthA = radius - a.dot(hip);
  const double depthB = radius - b.dot(hip);
  return {kWallStiffness * std::max(0.0, (depthA - c * depthB) / (1 - c * c)),
          kWallStiffness * std::max(0.0, (depthB - c * depthA) / (1 - c * c))};
}

// The hand slides along a groove, 3 mm deep, while one wall turns about the bottom line: one deforming mesh,
// or two rigid walls. Friction is mu (N_A + N_B).
TEST_P(MovingFrictionTest, a_groove_that_opens_or_closes_keeps_its_friction) {
  constexpr double kMu = 0.5;
  constexpr double kStart_s = 0.3;
  const double right = std::numbers::pi / 4;
  int combination = 0;
  for (const bool rigid : {false, true}) {
    for (const double turn_rad_per_s : {0.02, 0.2, -0.02, -0.2}) {
      for (const double lean : {-0.1, 0.1}) {
        if (!tried(combination++)) continue;
        SCOPED_TRACE(std::to_string(rigid) + " " + std::to_string(turn_rad_per_s) + " " +
                     std::to_string(lean));
        const auto opened = [&](double t) { return turn_rad_per_s * std::max(0.0, t - kStart_s); };
        const auto both = [&](double t) {
          TriangleMesh mesh = leftWall(right);
          const TriangleMesh other = rightWall(right - opened(t));
          mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
          mesh.triangles.insert(mesh.triangles.end(), {{4, 5, 6}, {4, 6, 7}});
          return mesh;
        };
        const auto wallA = geometryOf(leftWall(right), 2);
        const auto wallB = geometryOf(rightWall(right), 3);
        const auto sceneAt = [&](int tick) {
          SceneFixture scene;
          const scene::Surface s = surface(kWallStiffness, kMu, kMu);
          if (rigid) {
            scene.add(wallA, s);
            scene.add(wallB, s, poseAt(tick, 0, [&](double t) {
                        return Affine(Eigen::AngleAxisd(-opened(t), Vec3::UnitX()));
                      }));
          } else {
            const double t = tick * 1e-3;
            scene.add(deforming(both(t - 0.016), both(t), both(t + 0.016), tick), s);
          }
          return scene.snapshot();
        };
        Hand hand(sceneAt(0), options());
        for (int tick = 0; tick < 1000; ++tick) {
          if (tick > 0 && tick % kPose == 0) hand.show(sceneAt(tick));
          const double t = tick * 1e-3;
          const Vec3 hip(-0.005 + 0.01 * t, 0.003 * lean, bottom() - 0.003 + std::max(0.0, 0.006 - 0.03 * t));
          const Rendering& r = hand.at(hip);
          if (tick < 500) continue;
          // The vertices move on straight lines between two shapes.
          const double angle = right - opened(t);
          const auto [a, b] = normalForces(Vec3(0, std::sin(right), std::cos(right)),
                                           Vec3(0, -std::sin(angle), std::cos(angle)), radius(), hip);
          ASSERT_NEAR(-r.force_N.x(), kMu * (a + b), 0.03 * kMu * (a + b)) << tick;
        }
      }
    }
  }
}

// A hand is stuck on a floor at rest, and its friction bears 2 N of at most 3.2 N in y. A block touches it
// from the side, where it bears nothing in y, pushes it 2 mm on and creeps up.
TEST_P(MovingFrictionTest, a_block_that_touches_a_stuck_tool_leaves_its_friction) {
  int combination = 0;
  for (const double muOfBlock : {0.0, 0.8}) {
    for (const double creep : {0.0, 0.02, 0.1, 0.5}) {
      for (const double lean : {0.0, 0.35}) {
        for (const double speed : {0.002, 0.02}) {
          if (!tried(combination++)) continue;
          SCOPED_TRACE(std::to_string(muOfBlock) + " " + std::to_string(creep) + " " + std::to_string(lean) +
                       " " + std::to_string(speed));
          const auto floor = geometryOf(plane(0.05), 1);
          const auto block = geometryOf(blockFace(lean), 2);
          const auto sceneWith = [&](const scene::Motion& motion) {
            SceneFixture scene;
            scene.add(floor, surface(kWallStiffness, 0.8, 0.8));
            scene.add(block, surface(kWallStiffness, muOfBlock, muOfBlock), motion);
            return scene.snapshot();
          };
          const Vec3 away(0.004 + radius(), 0, 0);
          const Vec3 hip(0, 0.002, radius() - 0.004);
          Hand hand(sceneWith(scene::Motion::fixed(shifted(away))), options());
          hand.at(Vec3(0, 0, radius() + 0.001));
          hand.to(Vec3(0, 0, radius() - 0.004), 0.02);
          hand.to(hip, 0.02);
          ASSERT_NEAR(hand.now().force_N.y(), -2, 1e-3);
          const Nanos begin = hand.time();
          const int ticks = static_cast<int>(0.006 / speed * 1e3);
          Vec3 before = hand.now().force_N;
          for (int tick = 0; tick < ticks; ++tick) {
            if (tick % kPose == 0) {
              hand.show(sceneWith(poseAt(
                  tick, begin, [&](double t) { return shifted(away + speed * t * Vec3(-1, 0, creep)); })));
            }
            const Rendering& r = hand.at(hip);
            ASSERT_NEAR(r.force_N.y(), -2, 0.1) << tick;
            ASSERT_LE((r.force_N - before).norm(), 0.1) << tick;
            before = r.force_N;
          }
        }
      }
    }
  }
}

// The same while the hand slides in y: the floor bears mu N.
TEST_P(MovingFrictionTest, a_block_that_touches_a_sliding_tool_leaves_its_friction) {
  for (const double creep : {0.0, 0.02, 0.1}) {
    SCOPED_TRACE(creep);
    const auto floor = geometryOf(plane(0.05), 1);
    const auto block = geometryOf(blockFace(0), 2);
    const auto sceneWith = [&](const scene::Motion& motion) {
      SceneFixture scene;
      scene.add(floor, surface(kWallStiffness, 0.8, 0.8));
      scene.add(block, surface(), motion);
      return scene.snapshot();
    };
    const Vec3 away(0.001 + radius(), 0, 0);
    Vec3 hip(0, -0.02, radius() - 0.004);
    Hand hand(sceneWith(scene::Motion::fixed(shifted(away))), options());
    hand.at(hip + Vec3(0, 0, 0.005));
    hand.to(hip, 0.02);
    const auto slide = [&] {
      hip.y() += 1e-5;
      return hand.at(hip);
    };
    for (int i = 0; i < 600; ++i) slide();
    EXPECT_NEAR(hand.now().force_N.y(), -3.2, 1e-3);
    const Nanos begin = hand.time();
    for (int tick = 0; tick < 400; ++tick) {
      if (tick % kPose == 0) {
        hand.show(sceneWith(
            poseAt(tick, begin, [&](double t) { return shifted(away + 0.01 * t * Vec3(-1, 0, creep)); })));
      }
      ASSERT_NEAR(slide().force_N.y(), -3.2, 0.05) << tick;
    }
  }
}

// A floor without friction moves along itself, away from a wall at rest whose friction holds the hand in y.
TEST_P(MovingFrictionTest, a_frictionless_floor_takes_no_tool_off_a_wall) {
  for (const double speed : {-0.01, 0.01}) {
    SCOPED_TRACE(speed);
    const auto floor = geometryOf(plane(0.2), 1);
    TriangleMesh mirrored = blockFace(0);
    for (auto& t : mirrored.triangles) std::swap(t[1], t[2]);
    const auto wall = geometryOf(mirrored, 2);
    const auto sceneWith = [&](const scene::Motion& motion) {
      SceneFixture scene;
      scene.add(floor, surface(), motion);
      scene.add(wall, surface(kWallStiffness, 0.8, 0.8));
      return scene.snapshot();
    };
    Hand hand(sceneWith({}), options());
    const Vec3 hip(radius() - 0.003, 0, radius() - 0.004);
    hand.at(Vec3(radius() + 0.002, 0, radius() + 0.001));
    hand.to(hip, 0.02);
    hand.to(hip + Vec3(0, 0.002, 0), 0.02);
    const Nanos begin = hand.time();
    for (int tick = 0; tick < 400; ++tick) {
      if (tick % kPose == 0) {
        hand.show(sceneWith(poseAt(tick, begin, [&](double t) { return shifted(Vec3(speed * t, 0, 0)); })));
      }
      const Rendering& r = hand.at(hip + Vec3(0, 0.002, 0));
      ASSERT_NEAR((r.force_N - Vec3(3, -2, 4)).norm(), 0, 1e-3) << tick;
    }
  }
}

// A frictionless floor runs past a corrugated wall at rest that holds the hand by friction. It takes no tool
// from one corrugation to the next.
TEST_P(MovingFrictionTest, a_frictionless_floor_drags_no_tool_over_corrugations) {
  for (const double speed : {-0.3, 0.3}) {
    SCOPED_TRACE(speed);
    TriangleMesh corrugated =
        heightField(0.01, 100, [](double x, double) { return 2e-4 * std::sin(2e3 * std::numbers::pi * x); });
    for (auto& v : corrugated.vertices) v = Vec3f(v.x(), -v.z(), v.y());
    const auto floor = geometryOf(plane(1), 1);
    const auto wall = geometryOf(corrugated, 2);
    const auto sceneWith = [&](const scene::Motion& motion) {
      SceneFixture scene;
      scene.add(floor, surface(), motion);
      scene.add(wall, surface(kWallStiffness, 0.5, 0.5));
      return scene.snapshot();
    };
    Hand hand(sceneWith({}), options());
    const Vec3 hip(0, 0.001 - radius(), radius() - 0.004);
    hand.at(Vec3(0, -0.003 - radius(), radius() + 0.001));
    hand.to(hip, 0.02);
    const Vec3 force = hand.now().force_N;
    const Nanos begin = hand.time();
    for (int tick = 0; tick < 400; ++tick) {
      if (tick % kPose == 0) {
        hand.show(sceneWith(poseAt(tick, begin, [&](double t) { return shifted(Vec3(speed * t, 0, 0)); })));
      }
      ASSERT_NEAR((hand.at(hip).force_N - force).norm(), 0, 1e-3) << tick;
    }
  }
}

// A hand at rest in a groove along x. The walls slide along themselves; what each bears is mu N, as one pulls
// and the other holds or pulls back.
class GrooveOfTwo {
 public:
  GrooveOfTwo(double muOfA, double muOfB, const RenderOptions& options)
      : muOfA_(muOfA), muOfB_(muOfB), hand_(sceneWith({}, {}), options) {}

  void press(const Vec3& hip) {
    hand_.at(Vec3(0, 0, hip.z() + 0.005));
    hand_.to(hip, 0.05);
  }
  // From now on, for one second.
  void move(double speedOfA, double speedOfB) {
    const Nanos t = hand_.time();
    const auto motion = [&](double speed) {
      return scene::Motion::between(shifted(Vec3::Zero()), shifted(Vec3(speed, 0, 0)), t, t + 1000 * kTick);
    };
    hand_.show(sceneWith(motion(speedOfA), speedOfB != 0 ? motion(speedOfB) : scene::Motion{}));
  }
  Hand& hand() { return hand_; }

 private:
  std::shared_ptr<const scene::SceneSnapshot> sceneWith(const scene::Motion& a,
                                                        const scene::Motion& b) const {
    SceneFixture scene;
    scene.add(geometryOf(leftWall(std::numbers::pi / 4), 1), surface(kWallStiffness, muOfA_, muOfA_), a);
    scene.add(geometryOf(rightWall(std::numbers::pi / 4), 2), surface(kWallStiffness, muOfB_, muOfB_), b);
    return scene.snapshot();
  }

  double muOfA_;
  double muOfB_;
  Hand hand_;
};

const Vec3 kNormalOfA = Vec3(0, 1, 1).normalized();
const Vec3 kNormalOfB = Vec3(0, -1, 1).normalized();

TEST_P(MovingFrictionTest, each_wall_pulls_with_its_own_friction) {
  int combination = 0;
  for (const auto& [muOfA, muOfB] : {std::pair(0.5, 0.5), {0.5, 0.2}, {0.2, 0.5}, {0.5, 0.0}, {0.0, 0.5}}) {
    for (const double lean : {-0.2, -1e-3, 0.0, 1e-6, 0.2}) {
      for (const double speedOfB : {0.0, -0.018, 0.018}) {
        for (const double speedOfA : {0.015}) {
          if (!tried(combination++)) continue;
          SCOPED_TRACE(std::to_string(muOfA) + " " + std::to_string(muOfB) + " " + std::to_string(lean) +
                       " " + std::to_string(speedOfB) + " " + std::to_string(speedOfA));
          const Vec3 hip(0, 0.002 * lean, bottom() - 0.002);
          const auto [a, b] = normalForces(kNormalOfA, kNormalOfB, radius(), hip);
          GrooveOfTwo groove(muOfA, muOfB, options());
          groove.press(hip);
          groove.move(speedOfA, speedOfB);
          for (int i = 0; i < 900; ++i) groove.hand().at(hip);
          const double pull = muOfA * a;
          const double other = muOfB * b;
          // A wall at rest holds the tool as long as it can, and then as much as it can.
          const double expected = speedOfB == 0  ? std::max(0.0, pull - other)
                                  : speedOfB > 0 ? pull + other
                                                 : pull - other;
          const Rendering& r = groove.hand().now();
          EXPECT_NEAR(r.force_N.x(), expected, 1e-3);
          double sum = 0;
          for (std::uint32_t i = 0; i < r.contactCount; ++i) {
            const double x = r.contacts[i].force_N.x();
            sum += x;
            if (r.contacts[i].object == 0) {
              EXPECT_NEAR(x, pull, 1e-3);
            }
          }
          EXPECT_NEAR(sum, r.force_N.x(), 1e-9);
        }
      }
    }
  }
}

// Which wall is pressed harder changes nothing at once: the hand sways across the middle.
TEST_P(MovingFrictionTest, the_harder_pressed_wall_changes_without_a_step) {
  for (const double muOfB : {0.0, 0.2, 0.5}) {
    SCOPED_TRACE(muOfB);
    GrooveOfTwo groove(0.5, muOfB, options());
    const Vec3 middle(0, 0, bottom() - 0.002);
    groove.press(middle);
    groove.move(0.05, 0);
    double before = 0;
    for (int i = 0; i < 900; ++i) {
      const Vec3 hip = middle + Vec3(0, 1e-4 * std::sin(2e-3 * 2 * std::numbers::pi * i), 0);
      const auto [a, b] = normalForces(kNormalOfA, kNormalOfB, radius(), hip);
      const double x = groove.hand().at(hip).force_N.x();
      // The tool moves with the wall at most, and the normal forces change by 1 mN a tick.
      EXPECT_NEAR(x, before, kWallStiffness * 0.05e-3 + 2e-3) << i;
      if (i > 200) {
        EXPECT_LE(x, 0.5 * a + muOfB * b + 1e-3) << i;
        EXPECT_GE(x, 0.5 * a - muOfB * b - 1e-3) << i;
      }
      before = x;
    }
  }
}

// They carry the tool until both together cannot hold it.
TEST_P(MovingFrictionTest, walls_that_move_alike_are_one_body) {
  for (const double mu : {0.2, 0.5}) {
    SCOPED_TRACE(mu);
    GrooveOfTwo groove(mu, mu, options());
    const Vec3 hip(0, 0.0001, bottom() - 0.002);
    groove.press(hip);
    groove.move(0.01, 0.01);
    const auto [a, b] = normalForces(kNormalOfA, kNormalOfB, radius(), hip);
    for (int i = 0; i < 900; ++i) {
      const double x = groove.hand().at(hip).force_N.x();
      EXPECT_NEAR(x, std::min(kWallStiffness * 0.01 * i * 1e-3, mu * (a + b)), 1e-3) << i;
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture

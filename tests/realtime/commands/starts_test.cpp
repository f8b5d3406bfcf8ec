// Objects and meshes that start to move beside a resting hand, streams of poses that stall, late ticks, and
// poses that are too far to be a motion. The oracle is the client's own path of a flat face.
#include <cmath>
#include <random>

#include "loop.h"
#include "realtime/render/meshes.h"
#include "reduced.h"

namespace hapticd::realtime::commands {
namespace {

constexpr double kFrame_s = 1.0 / 60;
constexpr double kThickness_m = 0.020;  // of the solid plate

// A solid plate or a thin sheet whose upper face is at y = 0 of its frame.
std::vector<Vec3f> plate(bool solid) {
  return solid ? boxTriples(Vec3(-40, -1e3 * kThickness_m, -40), Vec3(40, 0, 40)) : sheetTriples(40);
}

class Starts : public testing::TestWithParam<std::tuple<bool, double>> {
 protected:
  static constexpr double kHeight_m = 0.003;  // of the hand, at rest

  Starts() : loop({.toolRadius_m = std::get<1>(GetParam())}) {
    loop.add(0, plate(std::get<0>(GetParam())));
    loop.place(0, {0, top_mm(0), 0});
    loop.rest(hip, toNanos(0.5));
  }
  double radius() const { return std::get<1>(GetParam()); }
  // World height at which the plate's face is `gap` below the tool.
  double top_mm(double above_m) const { return 1e3 * (hip.y() - radius() - gap_m + above_m); }
  // The face is `depth` above the lowest point of the tool.
  ::testing::AssertionResult feels(double depth_m) const {
    const double force = loop.out.force_N.y();
    if (std::abs(force - kStiffness_N_per_m * depth_m) < 0.02 && loop.out.status == 0)
      return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure()
           << "force " << force << " N at depth " << depth_m << " m, status " << loop.out.status;
  }

  const Vec3 hip{0.001, kHeight_m, 0.002};
  double gap_m = 0.0005;
  Loop loop;
};
INSTANTIATE_TEST_SUITE_P(, Starts, testing::Combine(testing::Bool(), testing::Values(0.0, 0.002)),
                         [](const auto& test) {
                           return std::string(std::get<0>(test.param) ? "solid_" : "sheet_") +
                                  (std::get<1>(test.param) > 0 ? "ball" : "point");
                         });

TEST_P(Starts, object_at_rest_that_starts_to_move_takes_the_hand_along) {
  for (const double speed : {0.02, 0.05, 0.3, 0.9}) {
    loop.place(0, {0, top_mm(0), 0});
    loop.rest(hip, toNanos(0.5));
    const double way = std::min(0.02, 0.3 * speed);
    Nanos next = loop.now;
    const Nanos begin = loop.now;
    while (loop.now < begin + toNanos(way / speed)) {
      if (loop.now >= next) {
        loop.place(0, {0, top_mm(speed * base::toSeconds(next - begin + toNanos(kFrame_s))), 0});
        next += toNanos(kFrame_s);
      }
      loop.tick(hip);
    }
    loop.place(0, {0, top_mm(way), 0});
    loop.rest(hip, 100 * kMs);
    EXPECT_TRUE(feels(way - gap_m)) << speed << " m/s";
  }
}

TEST_P(Starts, single_pose_after_a_pause_is_a_motion) {
  for (const double way : {0.001, 0.005, 0.019}) {
    loop.place(0, {0, top_mm(0), 0});
    loop.rest(hip, toNanos(2));
    loop.place(0, {0, top_mm(way), 0});
    double last = 0;
    loop.rest(hip, 60 * kMs, [&] {
      EXPECT_LE(loop.out.force_N.y() - last, kStiffness_N_per_m * 1.0001e-3 * std::max(1.0, way / 0.016))
          << "slower than 1 m/s";
      last = loop.out.force_N.y();
    });
    EXPECT_TRUE(feels(way - gap_m)) << way << " m";
  }
}

// The client goes on where it would be after the stall.
TEST_P(Starts, stalled_stream_does_not_swallow_the_hand) {
  int felt = 0;
  for (const double speed : {0.02, 0.05, 0.1, 0.3}) {
    for (const double stall : {0.09, 0.11, 0.3}) {
      for (const double before : {0.0, 0.2, 0.9}) {  // share of the stall's way between the face and the hand
        const double way = speed * (stall + 0.05);
        loop.place(0, {0, top_mm(-0.06), 0});
        loop.rest(hip, toNanos(0.5));
        Nanos next = loop.now;
        const Nanos begin = loop.now;
        const double start = -0.2 * speed - before * way;
        const auto path = [&](Nanos t) { return start + speed * base::toSeconds(t - begin); };
        bool released = false;
        const auto stream = [&](Nanos duration) {
          for (const Nanos end = loop.now + duration; loop.now < end;) {
            if (loop.now >= next) {
              loop.place(0, {0, top_mm(path(loop.now)), 0});
              next = loop.now + toNanos(kFrame_s);
            }
            loop.tick(hip);
            released = released || loop.out.status != 0;
          }
        };
        stream(toNanos(0.2));
        const double standing = path(loop.now);
        loop.rest(hip, toNanos(stall), [&] { released = released || loop.out.status != 0; });
        const bool jump = path(loop.now) - standing > 0.02 - 0.3 * kFrame_s;
        next = loop.now;
        stream(toNanos(0.05));
        const double end = std::max(path(loop.now), gap_m + 0.001);
        loop.place(0, {0, top_mm(end), 0});
        loop.rest(hip, 100 * kMs);
        if (jump && released) continue;  // a jump may release the hand, with a status
        EXPECT_TRUE(feels(end - gap_m)) << speed << " m/s, stall of " << stall << " s, " << before;
        ++felt;
      }
    }
  }
  EXPECT_GE(felt, 24);
}

// Periods of 3 to 50 ms at random while the plate rams the hand.
TEST_P(Starts, late_ticks_do_not_swallow_the_hand) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  const int rounds = reduced(30);
  int rams = 0;
  for (const double speed : {0.1, 0.3, 0.5, 1.0}) {
    for (int round = 0; round < rounds; ++round) {
      const double way = 0.012 + 0.01 * uniform(random);
      const double start = -0.01 - 0.03 * uniform(random);
      loop.place(0, {0, top_mm(-0.06), 0});
      loop.rest(hip, toNanos(0.3));
      const Nanos begin = loop.now;
      const auto path = [&](Nanos t) { return std::min(way, start + speed * base::toSeconds(t - begin)); };
      Nanos next = begin;
      bool ended = false;
      while (!ended) {
        const Nanos period = uniform(random) < 0.25 ? toNanos(0.003 + 0.047 * uniform(random)) : kMs;
        const Nanos due = loop.now + period;
        while (next <= due && !ended) {  // the scene thread is not late
          loop.now = next;
          loop.place(0, {0, top_mm(path(next)), 0});
          ended = path(next) == way;
          next += toNanos(kFrame_s);
        }
        loop.now = due;
        loop.render(hip, period);
      }
      loop.rest(hip, 100 * kMs);
      EXPECT_TRUE(feels(way - gap_m)) << speed << " m/s, round " << round;
      ++rams;
    }
  }
  EXPECT_EQ(rams, 4 * rounds);
}

// The hand ends outside on the near side, or released with a status; never silently inside or beyond.
TEST_P(Starts, pose_that_is_too_far_never_swallows_the_hand_silently) {
  for (const double way : {0.0203, 0.021, 0.03, 0.06, 0.2, 1.0}) {
    loop.place(0, {0, top_mm(-0.002), 0});
    loop.rest(hip, toNanos(1));
    loop.place(0, {0, top_mm(way), 0});
    std::uint32_t status = 0;
    loop.rest(hip, 60 * kMs, [&] { status |= loop.out.status; });
    const bool above = loop.out.proxy_m.y() - radius() >= 1e-3 * top_mm(way) - 1e-6;
    const bool released = loop.out.force_N.norm() == 0;
    EXPECT_TRUE(above || released) << way;
    EXPECT_NE(status & (kRenderGeometryJump | kRenderReleased), 0U) << way;
    if (released && std::get<0>(GetParam()) && way - gap_m < kThickness_m + 2 * radius()) {
      EXPECT_NE(loop.out.status & kRenderReleased, 0U) << way;
    }
    // Once the hand has left, the plate is felt again.
    loop.place(0, {0, top_mm(-0.06), 0});
    loop.rest(hip, toNanos(0.2));
    loop.place(0, {0, top_mm(-0.001), 0});
    loop.rest(hip, toNanos(0.2));
    EXPECT_EQ(loop.out.status, 0U) << way;
    EXPECT_NEAR(loop.to(hip - Vec3(0, gap_m + 0.003, 0)).force_N.y(), kStiffness_N_per_m * 0.002, 0.02)
        << way;
    loop.to(hip);
  }
}

TEST_P(Starts, object_far_from_the_hand_may_jump) {
  loop.add(1, boxTriples(Vec3::Constant(-5), Vec3::Constant(5)));
  loop.place(1, {500, 0, 0});
  loop.rest(hip, toNanos(0.5));
  loop.place(1, {-500, 300, 200});
  loop.rest(hip, 100 * kMs, [&] { EXPECT_EQ(loop.out.status, 0U); });
  loop.place(0, {0, top_mm(0.003), 0});
  loop.rest(hip, 100 * kMs);
  EXPECT_TRUE(feels(0.003 - gap_m));
}

// Vertices that move after a pause.
TEST_P(Starts, mesh_that_starts_to_deform_takes_the_hand_along) {
  const auto shifted = [&](double by_mm) {
    std::vector<Vec3f> vertices = plate(std::get<0>(GetParam()));
    for (Vec3f& v : vertices) v.y() += static_cast<float>(by_mm);
    return vertices;
  };
  for (const double way : {0.001, 0.005, 0.019}) {
    loop.send(scene::SetVertices{0, 0, shifted(0)});
    loop.rest(hip, toNanos(1));
    loop.send(scene::SetVertices{0, 0, shifted(1e3 * way)});
    double last = 0;
    loop.rest(hip, 100 * kMs, [&] {
      EXPECT_LE(loop.out.force_N.y() - last, kStiffness_N_per_m * 1.2e-3) << "about 1 m/s at most";
      last = loop.out.force_N.y();
    });
    EXPECT_TRUE(feels(way - gap_m)) << way << " m";
  }
}

// A floor of two plates that turns about their seam, where the hand presses. Each plate has an origin and a
// size of its own.
TEST(Assembly, parts_that_turn_together_leave_no_gap) {
  for (const double radius : {0.0, 0.002}) {
    for (const double angle : {0.03, 0.1, -0.2, 0.3}) {
      Loop loop({.toolRadius_m = radius});
      const Vec3 origins_mm[] = {{60, 30, 10}, {-50, -40, -20}};
      const float ends_mm[] = {-10, 45};
      for (int id = 0; id < 2; ++id) {
        std::vector<Vec3f> plate = sheetTriples(40);
        for (Vec3f& v : plate) v.x() = v.x() * ends_mm[id] < 0 ? 0 : ends_mm[id];
        for (Vec3f& v : plate) v -= origins_mm[id].cast<float>();
        loop.add(id, plate);
      }
      const auto place = [&](double turn, double up_mm) {
        geometry::Mat3 rotation(Eigen::AngleAxisd(turn, Vec3::UnitZ()));
        loop.send(scene::BeginBatch{});
        for (int id = 0; id < 2; ++id) {
          const Vec3 at = rotation * origins_mm[id] + Vec3(0, up_mm, 0);
          scene::SetTransform pose{id, {}};
          Eigen::Map<geometry::Mat4> matrix(pose.matrix.data());
          matrix.setIdentity();
          matrix.topLeftCorner<3, 3>() = rotation;
          matrix.topRightCorner<3, 1>() = at;
          loop.send(pose);
        }
        loop.send(scene::CommitBatch{});
        loop.publish();
      };
      place(0, 0);
      const Vec3 above(0, 0.003 + radius, 0.003);
      loop.rest(above, toNanos(0.5));
      const Vec3 pressed = above - Vec3(0, 0.006, 0);
      loop.to(pressed);
      loop.rest(pressed, toNanos(0.2));
      ASSERT_NEAR(loop.out.force_N.norm(), 0.003 * kStiffness_N_per_m, 0.01);
      place(angle, 2);
      loop.rest(pressed, toNanos(0.2));
      EXPECT_NEAR(loop.out.force_N.norm(), kStiffness_N_per_m * (radius + (0.005 - radius) * std::cos(angle)),
                  0.03)
          << angle << ' ' << radius;
    }
  }
}

// A stream of shapes whose face passes the hand between two ticks, in one of which a new shape arrives.
TEST_P(Starts, shape_that_follows_another_passes_the_hand) {
  const auto shifted = [&](double by_mm) {
    std::vector<Vec3f> vertices = plate(std::get<0>(GetParam()));
    for (Vec3f& v : vertices) v.y() += static_cast<float>(by_mm);
    return vertices;
  };
  constexpr double kSpeed_m_per_s = 0.4;
  constexpr double kAbove_m = 0.003;
  for (int meeting = 0; meeting < 30; ++meeting) {
    // The face is that far below the tool when the second shape arrives, and meets it before the next tick.
    const double below = kSpeed_m_per_s * 1e-3 * (meeting + 0.5) / 30;
    loop.send(scene::SetVertices{0, 0, shifted(-30)});
    loop.rest(hip, toNanos(0.3));
    loop.send(scene::SetVertices{0, 0, shifted(1e3 * (gap_m - below - kSpeed_m_per_s * 0.015))});
    loop.rest(hip, toNanos(0.3));
    loop.send(scene::SetVertices{0, 0, shifted(1e3 * (gap_m - below + kSpeed_m_per_s * 0.001))});
    loop.rest(hip, 15 * kMs);
    ASSERT_EQ(loop.out.force_N.norm(), 0);
    loop.now += kMs;
    loop.send(scene::SetVertices{0, 0, shifted(1e3 * (gap_m + kAbove_m))});
    loop.publish();
    loop.render(hip, kMs);
    loop.rest(hip, 100 * kMs);
    EXPECT_TRUE(feels(kAbove_m)) << meeting;
  }
}

// Vertices that leap under a hand in contact.
TEST_P(Starts, touched_mesh_that_leaps_lets_the_hand_go) {
  const auto shifted = [&](const Vec3& by_mm) {
    std::vector<Vec3f> vertices = plate(std::get<0>(GetParam()));
    for (Vec3f& v : vertices) v += by_mm.cast<float>();
    return vertices;
  };
  for (const Vec3& by_mm : {Vec3(0, 200, 0), Vec3(300, 100, 0), Vec3(0, 2000, 0)}) {
    loop.send(scene::SetVertices{0, 0, shifted(Vec3(0, -30, 0))});
    loop.rest(hip, toNanos(0.5));
    loop.send(scene::SetVertices{0, 0, shifted(Vec3(0, -10, 0))});
    loop.rest(hip, toNanos(0.3));
    loop.send(scene::SetVertices{0, 0, shifted(Vec3(0, 3, 0))});
    loop.rest(hip, toNanos(0.3));
    ASSERT_TRUE(feels(0.003 - gap_m)) << by_mm.transpose();
    loop.send(scene::SetVertices{0, 0, shifted(by_mm)});
    std::uint32_t status = 0;
    loop.rest(hip, 100 * kMs, [&] {
      status |= loop.out.status;
      EXPECT_LE(loop.out.force_N.norm(), 0.030 * kStiffness_N_per_m + 0.01) << by_mm.transpose();
    });
    EXPECT_EQ(loop.out.force_N.norm(), 0) << by_mm.transpose();
    EXPECT_NE(status & (kRenderReleased | kRenderGeometryJump), 0U) << by_mm.transpose();
  }
}

// Frames in quick succession: a frame's way takes at least its distance at 1 m/s.
TEST_P(Starts, quick_frames_of_a_mesh_do_not_swallow_the_hand) {
  const auto shifted = [&](double by_mm) {
    std::vector<Vec3f> vertices = plate(std::get<0>(GetParam()));
    for (Vec3f& v : vertices) v.y() += static_cast<float>(by_mm);
    return vertices;
  };
  loop.send(scene::SetVertices{0, 0, shifted(-1)});
  loop.rest(hip, 5 * kMs);
  loop.send(scene::SetVertices{0, 0, shifted(18)});
  loop.rest(hip, 100 * kMs);
  EXPECT_TRUE(feels(0.018 - gap_m));
}

// A soft body that a simulation resets: its vertices come back from afar, and it rests. The oracle is the
// sphere; facets are less than 0.02 mm inside of it.
TEST(Leaps, fine_mesh_that_came_back_is_felt_in_every_tick) {
  constexpr double kRadius_m = 0.020;
  constexpr double kDepth_m = 0.002;
  const auto sphere = [&](double aside_mm) {
    std::vector<Vec3f> triples = triplesOf(fixture::sphere(1e3 * kRadius_m, 50));
    for (Vec3f& v : triples) v += Vec3f::Constant(static_cast<float>(aside_mm));
    return triples;
  };
  for (const double radius : {0.0, 0.001}) {
    for (const double aside_mm : {50.0, 3e6}) {
      Loop loop({.toolRadius_m = radius});
      loop.add(0, sphere(0));
      const Vec3 away(0.04, -0.04, 0.04);
      loop.rest(away, toNanos(0.1));
      for (const double to_mm : {aside_mm, 0.0}) {
        loop.send(scene::SetVertices{0, 0, sphere(to_mm)});
        loop.rest(away, toNanos(0.2));
      }
      loop.to({0.02, 0.02, 0.02});
      int silent = 0;
      loop.to(Vec3::Constant((kRadius_m + radius - kDepth_m) / std::sqrt(3)),
              [&] { silent += loop.out.status != 0 ? 1 : 0; });
      EXPECT_EQ(silent, 0) << aside_mm << " mm, tool " << radius;
      EXPECT_NEAR(loop.out.force_N.norm(), kStiffness_N_per_m * kDepth_m, 0.02)
          << aside_mm << " mm, tool " << radius;
    }
  }
}

// More faces pass the hand than a tick can examine: it ends outside, or the client reads that it is inside.
// The oracle is the sphere.
TEST(Leaps, fine_mesh_that_leaps_over_the_hand_does_not_swallow_it_silently) {
  constexpr double kRadius_m = 0.020;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int inside = 0;
  int beyond = 0;
  for (int round = 0; round < 12; ++round) {
    const Vec3 way = Vec3(uniform(random), uniform(random), uniform(random)).normalized();
    const double ahead_m = 0.5 * (1.1 + 0.9 * uniform(random)) * 0.03;
    const double leap_m = round % 2 == 0 ? 0.03 : 0.06;
    const Vec3 hip = (kRadius_m + ahead_m) * way;
    const auto sphere = [&](double by_m) {
      std::vector<Vec3f> triples = triplesOf(fixture::sphere(1e3 * kRadius_m, 50));
      for (Vec3f& v : triples) v += (1e3 * by_m * way).cast<float>();
      return triples;
    };
    Loop loop;
    loop.add(0, sphere(0));
    loop.rest(hip, toNanos(0.3));
    loop.send(scene::SetVertices{0, 0, sphere(leap_m)});
    loop.rest(hip, toNanos(0.3));
    if ((hip - leap_m * way).norm() > kRadius_m) {
      ++beyond;
      continue;
    }
    ++inside;
    EXPECT_TRUE(loop.out.force_N.norm() > 0 || (loop.out.status & (kRenderEnclosed | kRenderReleased)) != 0)
        << "round " << round;
    // Once the hand has left, the sphere is felt.
    loop.to((leap_m + kRadius_m + 0.005) * way);
    loop.rest((leap_m + kRadius_m + 0.005) * way, toNanos(0.1));
    loop.to((leap_m + kRadius_m - 0.002) * way);
    EXPECT_NEAR(loop.out.force_N.norm(), kStiffness_N_per_m * 0.002, 0.02) << "round " << round;
    EXPECT_EQ(loop.out.status, 0U) << "round " << round;
  }
  EXPECT_GE(inside, 6);
  EXPECT_GE(beyond, 2);
}

TEST_P(Starts, late_ticks_during_a_deformation_do_not_swallow_the_hand) {
  const auto shifted = [&](double by_mm) {
    std::vector<Vec3f> vertices = plate(std::get<0>(GetParam()));
    for (Vec3f& v : vertices) v.y() += static_cast<float>(by_mm);
    return vertices;
  };
  for (const Nanos late : {5 * kMs, 20 * kMs, 50 * kMs}) {
    loop.send(scene::SetVertices{0, 0, shifted(-20)});
    loop.rest(hip, toNanos(0.3));
    const Nanos due = loop.now + late;
    // Frames every 10 ms that the servo does not see.
    for (double by = -12; loop.now < due; by += 8) {
      loop.send(scene::SetVertices{0, 0, shifted(std::min(4.0, by))});
      loop.now = std::min(due, loop.now + 5 * kMs);
      loop.publish();
      loop.now = std::min(due, loop.now + 5 * kMs);
    }
    loop.render(hip, late);
    loop.send(scene::SetVertices{0, 0, shifted(4)});
    loop.rest(hip, 100 * kMs);
    EXPECT_TRUE(feels(0.004 - gap_m)) << late;
  }
}

// A jump is not swept, whether the mesh deforms meanwhile or not.
TEST(Jumps, view_that_jumps_over_a_free_hand_while_the_mesh_deforms) {
  for (const double radius_m : {0.0, 0.002}) {
    Loop loop({.toolRadius_m = radius_m});
    const Vec3 hip(0.001, 0.004, 0.002);
    loop.add(0, sheetTriples(60));
    loop.rest(hip, toNanos(0.4));
    for (int i = 0; i < 20; ++i) {
      loop.send(scene::SetVertices{0, 0, sheetTriples(60, i % 2 == 0 ? 0.05 : 0)});
      loop.rest(hip, toNanos(0.016));
    }
    loop.send(scene::SetVertices{0, 0, sheetTriples(60, 0.05)});
    loop.tick(hip);
    loop.send(scene::SetHapticOrigin{Vec3(0, -0.028, 0), Vec3::UnitZ(), 0});
    loop.rest(hip, toNanos(0.1), [&] { EXPECT_EQ(loop.out.force_N.norm(), 0) << radius_m; });
  }
}

// A box that goes away from a pressed hand and comes back around it is felt again once the hand has left it,
// wherever it leaves, and so is what the hand meets then.
TEST(Jumps, box_that_comes_back_around_the_hand_is_felt_once_the_hand_has_left) {
  constexpr double kPress_m = 0.002;
  for (const double radius_m : {0.0, 0.002}) {
    for (const double way_mm : {100.0, -100.0, 1e4}) {
      for (const Vec3& outside :
           {Vec3(0.001, 0.015, 0.002), Vec3(0.055, -0.02, 0.002), Vec3(0.001, -0.05, 0.002)}) {
        Loop loop({.toolRadius_m = radius_m});
        loop.add(0, boxTriples(Vec3(-40, -30, -40), Vec3(40, 0, 40)));
        loop.add(1, boxTriples(Vec3(-20, 25, -20), Vec3(20, 60, 20)));
        const Vec3 above(0.001, 0.010, 0.002);
        const Vec3 pressed(0.001, radius_m - kPress_m, 0.002);
        const Vec3 pressedFromBelow(0.001, 0.025 - radius_m + kPress_m, 0.002);
        loop.rest(above, toNanos(0.3));
        loop.to(pressed);
        ASSERT_NEAR(loop.out.force_N.y(), kStiffness_N_per_m * kPress_m, 1e-3);
        loop.place(0, {0, way_mm, 0});
        loop.rest(pressed, toNanos(0.2));
        loop.place(0, Vec3::Zero());
        loop.rest(pressed, toNanos(0.2));
        loop.to(outside);
        loop.rest(outside, toNanos(0.1));
        EXPECT_EQ(loop.out.force_N.norm(), 0) << way_mm << " to " << outside.transpose();
        EXPECT_EQ(loop.out.status, 0U) << way_mm << " to " << outside.transpose();
        EXPECT_LT((loop.out.proxy_m - outside).norm(), 1e-6) << way_mm << " to " << outside.transpose();
        for (const Vec3& corner : {Vec3(0.06, outside.y(), 0.002), Vec3(0.06, 0.01, 0.002), above})
          loop.to(corner);
        loop.to(pressedFromBelow);
        EXPECT_NEAR(loop.out.force_N.y(), -kStiffness_N_per_m * kPress_m, 1e-3) << way_mm;
        loop.to(above);
        loop.to(pressed);
        EXPECT_NEAR(loop.out.force_N.y(), kStiffness_N_per_m * kPress_m, 1e-3) << way_mm;
      }
    }
  }
}

// A client hides an object by sending it very far, and brings it back. 1e16 mm away the spacing of the
// numbers is 2 mm: no place beside the hand was known from there.
TEST(Jumps, box_that_was_sent_very_far_is_felt_again) {
  const Vec3 above(0.001, 0.06, 0.002);
  const Vec3 pressed(0.001, -0.002, 0.002);
  for (const double way_mm : {1e9, -1e12, 1e13, -1e16, 1e17, 1e20, -1e29}) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool withHandInside : {false, true}) {
        Loop loop;
        loop.add(0, boxTriples(Vec3(-40, -30, -40), Vec3(40, 0, 40)));
        loop.rest(above, toNanos(0.3));
        loop.to(pressed);
        loop.place(0, way_mm * Vec3::Unit(axis));
        loop.rest(pressed, toNanos(0.2));
        EXPECT_EQ(loop.out.force_N.norm(), 0) << way_mm << " along " << axis;
        if (!withHandInside) loop.to(above);
        loop.place(0, Vec3::Zero());
        loop.rest(withHandInside ? pressed : above, toNanos(0.2));
        loop.to(above);
        loop.rest(above, toNanos(0.2));
        loop.to(pressed);
        EXPECT_NEAR(loop.out.force_N.y(), kStiffness_N_per_m * 0.002, 1e-3)
            << way_mm << " along " << axis << ", " << withHandInside;
      }
    }
  }
}

// What jumps past a hand leaves it to what else it touches. Boxes of all sizes and heights above a floor,
// with one pose and with streams at 60 Hz.
TEST(Jumps, box_that_goes_past_the_hand_leaves_it_to_the_floor) {
  constexpr double kPress_m = 0.002;
  int past = 0;
  for (const double radius_m : {0.0, 0.002}) {
    for (const double speed_m_per_s : {0.0, 1.3, 1.5, 2.5}) {  // 0: one pose
      for (const double half_mm : {6.0, 15.0, 25.0}) {
        Loop loop({.toolRadius_m = radius_m});
        loop.add(0, boxTriples(Vec3(-300, -50, -300), Vec3(300, 0, 300)));
        loop.add(1, boxTriples(Vec3(-half_mm, -3, -half_mm), Vec3(half_mm, 25, half_mm)));
        const double start_mm = -2 * half_mm - 30;
        loop.place(1, {start_mm, 0, 1});
        const Vec3 above(0, radius_m + 0.010, 0);
        const Vec3 pressed(0, radius_m - kPress_m, 0);
        loop.rest(above, toNanos(0.3));
        loop.to(pressed);
        loop.rest(pressed, toNanos(0.1));
        ASSERT_NEAR(loop.out.force_N.y(), kStiffness_N_per_m * kPress_m, 1e-3);
        const double step_mm = speed_m_per_s > 0 ? 1e3 * speed_m_per_s / 60 : -2 * start_mm;
        for (double x = start_mm; x < -start_mm; x += step_mm) {
          loop.place(1, {std::min(x + step_mm, -start_mm), 0, 1});
          loop.rest(pressed, 16 * kMs);
        }
        loop.rest(pressed, toNanos(0.3));
        EXPECT_NEAR(loop.out.force_N.y(), kStiffness_N_per_m * kPress_m, 1e-3)
            << speed_m_per_s << " m/s, half a box of " << half_mm << " mm, proxy at "
            << loop.out.proxy_m.transpose();
        EXPECT_EQ(loop.out.status, 0U);
        const Vec3 deeper = pressed - Vec3(0, 0.005, 0);
        EXPECT_NEAR(loop.to(deeper).force_N.y(), kStiffness_N_per_m * (kPress_m + 0.005), 1e-3);
        ++past;
      }
    }
  }
  EXPECT_EQ(past, 24);
}

// A view that changes is no motion: damping would answer a step of one tick with a kick.
TEST(Jumps, view_that_steps_is_not_damped) {
  for (const double step_mm : {0.3, 1.0, 3.0, 10.0}) {
    Loop damped;
    Loop plain;
    for (Loop* loop : {&damped, &plain}) {
      loop->add(0, boxTriples(Vec3(-60, -50, -60), Vec3(60, 0, 60)));
      if (loop == &damped) loop->send(scene::SetSurfaceProperty{0, "damping", 1});
      const Vec3 hip(0.001, -0.002, 0.002);
      loop->rest(Vec3(0.001, 0.004, 0.002), toNanos(0.3));
      loop->to(hip);
      loop->rest(hip, toNanos(0.1));
      loop->send(scene::SetHapticOrigin{Vec3(0, -1e-3 * step_mm, 0), Vec3::UnitZ(), 0});
    }
    const Vec3 hip(0.001, -0.002, 0.002);
    for (int i = 0; i < 50; ++i) {
      const Vec3 force_N = plain.tick(hip).force_N;
      ASSERT_NEAR((damped.tick(hip).force_N - force_N).norm(), 0, 1e-9) << step_mm << " mm, tick " << i;
    }
    EXPECT_GT(plain.out.force_N.y(), 1);
  }
}

}  // namespace
}  // namespace hapticd::realtime::commands

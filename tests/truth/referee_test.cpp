// The reference and the referee themselves, on scenes whose answers are known.
#include "truth/referee.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "realtime/render/renderer.h"
#include "truth/descent.h"
#include "truth/follower.h"
#include "truth/free_space.h"
#include "truth/meshes.h"
#include "truth/random_trial.h"
#include "truth/reference.h"
#include "truth/shrink.h"
#include "truth/stage.h"

namespace hapticd::truth {
namespace {

Trial plate(double holeAt = 1, double holeWidth = 0) {
  Dice dice(1);
  Trial trial;
  Shape shape = patch({-0.02, -0.02, 0}, {holeAt < 1 ? 0.02 + holeAt - 0.5 * holeWidth : 0.04, 0, 0},
                      {0, 0.04, 0}, 2, 3, 0, dice);
  if (holeAt < 1) {
    const double begin = holeAt + 0.5 * holeWidth;
    shape.append(patch({begin, -0.02, 0}, {0.02 - begin, 0, 0}, {0, 0.04, 0}, 3, 2, 0, dice));
  }
  trial.objects.push_back(bake(shape, Pose{}));
  return trial;
}

bool joined(const Trial& trial, const Point& p, const Point& q, double reach) {
  Reference reference(trial);
  reference.moveTo(0);
  FreeSpace space(reference, 0.5 * (p + q), reach, 4.9e-6, 1);
  return space.connects(p, q);
}

TEST(FreeSpace, a_plate_separates_its_sides) {
  EXPECT_FALSE(joined(plate(), {0, 0, 1e-4}, {0, 0, -1e-4}, 1e-3));
}

TEST(FreeSpace, paths_lead_around_a_rim) {
  EXPECT_TRUE(joined(plate(), {0.0199, 0, 1e-4}, {0.0199, 0, -1e-4}, 1e-3));
}

TEST(FreeSpace, a_gap_below_the_tolerance_joins_nothing) {
  EXPECT_FALSE(joined(plate(0, 0), {0, 0, 1e-4}, {0, 0, -1e-4}, 4e-4));
  EXPECT_FALSE(joined(plate(0, 9e-6), {0, 0, 1e-4}, {0, 0, -1e-4}, 4e-4));
}

TEST(FreeSpace, a_wider_hole_joins_both_sides) {
  EXPECT_TRUE(joined(plate(0, 14e-6), {0, 0, 1e-4}, {1e-5, 0, -1e-4}, 4e-4));
}

TEST(FreeSpace, a_face_that_is_touchable_from_the_front_lets_through_what_comes_from_behind) {
  Trial trial = plate();
  trial.sides = Sides::front;
  EXPECT_FALSE(joined(trial, {0, 0, 1e-4}, {0, 0, -1e-4}, 1e-3));
  EXPECT_TRUE(joined(trial, {0, 0, -1e-4}, {0, 0, 1e-4}, 1e-3));
}

TEST(FreeSpace, a_ball_that_came_from_behind_may_overlap_a_one_sided_face_and_not_go_back) {
  Trial trial = plate();
  trial.sides = Sides::front;
  Reference reference(trial);
  reference.moveTo(0);
  FreeSpace space(reference, {0, 0, 0}, 1e-3, 4.9e-6, 1, true);
  EXPECT_TRUE(space.connects({0, 0, -1e-4}, {0, 0, 2e-6}));
  EXPECT_TRUE(space.connects({0, 0, 2e-6}, {0, 0, 1e-4}));
  EXPECT_FALSE(space.connects({0, 0, 1e-4}, {0, 0, 2e-6}));
  EXPECT_FALSE(space.connects({0, 0, 2e-6}, {0, 0, -1e-4}));
}

// On the plate, within rounding, the proxy may be on either side: where it came from decides.
TEST(Follower, follows_around_a_rim_and_not_through_a_plate) {
  const ReportedProxy above{{0.0195, 0, 1e-4}, false};
  const ReportedProxy on{{0.0195, 0, -1e-12}, false};
  const ReportedProxy slid{{0.0198, 0, 1e-12}, false};
  const ReportedProxy beside{{0.0201, 0, 0}, false};
  const ReportedProxy below{{0.0198, 0, -1e-4}, false};
  EXPECT_TRUE(follows(plate(), {above, on, slid, above}, 4.9e-6));
  EXPECT_TRUE(follows(plate(), {above, on, beside, below}, 4.9e-6));
  EXPECT_FALSE(
      follows(plate(0, 8e-6), {{{0, 0, 1e-4}, false}, {{0, 0, 0}, false}, {{0, 0, -1e-4}, false}}, 4.9e-6));
  EXPECT_TRUE(
      follows(plate(0, 14e-6), {{{0, 0, 1e-4}, false}, {{0, 0, 0}, false}, {{0, 0, -1e-4}, false}}, 4.9e-6));
}

TEST(Reference, distance_of_a_segment_from_a_triangle) {
  const Face f{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  EXPECT_DOUBLE_EQ(distanceOf(f, {0.2, 0.2, 1}, {0.3, 0.3, 2}), 1);
  EXPECT_DOUBLE_EQ(distanceOf(f, {0.2, 0.2, 1}, {0.3, 0.3, -1}), 0);
  EXPECT_DOUBLE_EQ(distanceOf(f, {-1, -1, 0}, {3, -1, 0}), 1);
  EXPECT_NEAR(distanceOf(f, {1, 1, -1}, {1, 1, 1}), std::sqrt(0.5), 1e-15);
}

TEST(Reference, carries_points_with_a_turning_object) {
  Trial trial = plate();
  Pose turned;
  turned.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.32, Point::UnitZ()));
  trial.objects[0].poses = {Pose{}, turned};
  Reference reference(trial);
  reference.moveTo(7);
  reference.moveTo(8);
  const Point p(std::cos(0.14), std::sin(0.14), 0.1);
  EXPECT_LT((reference.carried(p, 0) - Point(std::cos(0.16), std::sin(0.16), 0.1)).norm(), 1e-12);
  EXPECT_TRUE(reference.moved());
  reference.moveTo(20);
  reference.moveTo(21);
  EXPECT_FALSE(reference.moved());
}

// A ditch across the way down holds a ball that rolls by hand, though the way before it fell by more than its
// far side rises.
double rolledTo(double rise) {
  Trial trial;
  TrialObject& ditch = trial.objects.emplace_back();
  const std::array<Point, 4> section{Point(-400e-6, 0, 40e-6), Point(0, 0, 0), Point(30e-6, 0, rise),
                                     Point(900e-6, 0, rise - 90e-6)};
  for (const Point& p : section) {
    for (const double side : {-1e-3, 1e-3})
      ditch.vertices.push_back((p + side * Point::UnitY()).cast<float>());
  }
  for (std::uint32_t i = 0; i < 6; i += 2) {
    ditch.triangles.push_back({i, i + 2, i + 1});
    ditch.triangles.push_back({i + 1, i + 2, i + 3});
  }
  Reference reference(trial);
  reference.moveTo(0);
  const Point start(-100e-6, 0, 16e-6);
  Descent descent(reference, start, 1e-3, 5e-6, 1);
  return descent.from(start, {400e-6, 0, -20e-3}).x();
}

TEST(Descent, rolls_into_a_ditch_and_not_out) {
  EXPECT_NEAR(rolledTo(1.5e-6), 0, 5e-6);
  EXPECT_GT(rolledTo(-3e-6), 200e-6);
}

TEST(Trial, text_gives_the_same_trial) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Trial trial = randomTrial(seed);
    std::stringstream first;
    write(first, trial);
    std::stringstream second;
    write(second, read(first));
    EXPECT_EQ(first.str(), second.str());
  }
}

TEST(Trial, text_that_is_not_a_trial_is_refused) {
  std::istringstream nonsense("hip 1 2 x\n");
  EXPECT_THROW(read(nonsense), std::runtime_error);
  std::istringstream early("vertex 1 2 3\n");
  EXPECT_THROW(read(early), std::runtime_error);
}

// What the referee found before, shrunk. Each of these trials broke the rule in its name.
TEST(Referee, mended_findings_stay_mended) {
  RefereeOptions all;
  all.share = 1;
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(HAPTICD_TESTDATA "/truth")) {
    std::ifstream file(entry.path());
    const Verdict verdict = judge(read(file), all);
    EXPECT_GT(verdict.ticks, 1U) << entry.path();
    EXPECT_FALSE(verdict.finding) << entry.path() << ": " << verdict.finding->rule << ": "
                                  << verdict.finding->text;
    ++count;
  }
  EXPECT_GE(count, 57);
}

// A ball goes past an edge to the other side of a strip, 7 mm in the last tick, and the casts of the tick end
// there. Without friction the force is the stiffness times the depth, and the hand moves by 0.26 mm.
TEST(SpentCasts, what_holds_the_ball_is_found_where_they_end) {
  std::ifstream file(HAPTICD_TESTDATA "/truth/casts-103777.trial");
  const Trial trial = read(file);
  Stage stage(trial);
  realtime::Renderer renderer({trial.toolRadius_m, false});
  realtime::Rendering rendering;
  device::DeviceState state;
  double before = 0;
  for (std::size_t i = 0; i < trial.hips.size(); ++i) {
    state.time = static_cast<int>(i) * realtime::fixture::kTick;
    state.position_m = trial.hips[i];
    before = rendering.contactForce_N.norm();
    renderer.step(stage.at(static_cast<int>(i)), state, state.time, realtime::fixture::kTick, rendering);
  }
  EXPECT_NE(rendering.status & realtime::kRenderIterationLimit, 0U);
  const double way = (trial.hips.back() - trial.hips[trial.hips.size() - 2]).norm();
  EXPECT_NEAR(rendering.contactForce_N.norm(), before, trial.objects[0].material.stiffness_N_per_m * way);
}

// Where the renderer joins triangles, the proxy may be behind a face by 0.1 um and the force may be turned as
// much as the joined triangle is. Of the scenes that GCC draws from these seeds, a ball comes from behind
// one-sided faces in 85002009, 85003558 and 60251; clang draws others, for it computes arguments in another
// order.
TEST(Referee, joined_triangles_are_off_by_the_documented_error_and_no_more) {
  std::uint64_t touching = 0;
  for (const std::uint64_t seed :
       {60161U, 60251U, 85000663U, 85000902U, 85002009U, 85002538U, 85003227U, 85003558U}) {
    const Verdict verdict = judge(randomTrial(seed, "joined"));
    touching += verdict.touching;
    EXPECT_FALSE(verdict.finding) << seed << ": " << verdict.finding->rule << ": " << verdict.finding->text;
  }
  EXPECT_GT(touching, 1000U);
}

// A hand that presses on a plate: nothing to find. With a false wall in front of the plate, the referee finds
// it, and two ticks show it.
TEST(Referee, judges_a_press_and_shrinks_what_it_finds) {
  Trial trial = plate();
  for (int i = 0; i < 300; ++i) trial.hips.emplace_back(1e-5 * i, 2e-5 * i, 0.003 - 2e-5 * i);
  RefereeOptions all;
  all.share = 1;
  const Verdict clean = judge(trial, all);
  EXPECT_FALSE(clean.finding) << clean.finding->rule << clean.finding->text;
  EXPECT_GT(clean.longRules, 100U);
  trial.enclosure.push_back({-Point::UnitZ(), -0.001});
  const Verdict found = judge(trial, all);
  ASSERT_TRUE(found.finding);
  EXPECT_EQ(found.finding->rule, "escaped");
  const Trial small = shrink(trial, *found.finding);
  EXPECT_EQ(small.hips.size(), 2U);
}

}  // namespace
}  // namespace hapticd::truth

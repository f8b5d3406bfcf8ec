// The forces of a client that leaves only fall, however many were lowered to be passive together.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "loop.h"

namespace hapticd::realtime::commands {
namespace {

constexpr double kBound_N_per_m = 9990;  // of the simulated hand at 1 kHz
constexpr double kRounding = 1e-9;

void start(Loop& loop, std::int32_t index, const std::string& type, double gain) {
  loop.send(scene::DefineEffect{.type = type, .index = index, .gain = gain, .magnitude_N = 10});
  loop.send(scene::StartEffect{index});
}

void addField(Loop& loop, double stiffness_N_per_m) {
  const double j = -stiffness_N_per_m;
  loop.send(scene::SetForceField{.jacobian_N_per_m = {j, 0, 0, 0, j, 0, 0, 0, j}, .radius_m = 1});
}

void addConstraint(Loop& loop, double stiffness_N_per_m) {
  loop.send(scene::SetConstraintMode{1});
  loop.send(scene::SetConstraintStiffness{stiffness_N_per_m});
  loop.send(scene::SetConstraintEnabled{true});
}

// A view that is turned by a right angle, of half the scale and off the centre.
void turnView(Loop& loop) {
  loop.send(scene::SetHapticScale{0.5});
  loop.send(
      scene::SetHapticOrigin{.position_m = {0.01, 0.02, 0}, .axis = {0, 0, 1}, .angle_rad = std::asin(1.0)});
}
Vec3 inTurnedView(const Vec3& device_m) {
  return {10 - 500 * device_m.y(), 20 + 500 * device_m.x(), 500 * device_m.z()};
}

// Rests until the client has gone and nothing is left.
void leavesOnlyFalling(Loop& loop, const Vec3& hip_m, double before_N) {
  const double rested_N = loop.rest(hip_m, 100 * kMs).force_N.norm();
  EXPECT_NEAR(rested_N, before_N, 1e-3 * before_N);
  loop.leave(1);
  const Nanos left = loop.now;
  loop.rest(hip_m, 400 * kMs, [&] {
    const double share = std::clamp(1 - base::toSeconds(loop.now - left - kMs) / 0.25, 0.0, 1.0);
    EXPECT_LE(loop.out.force_N.norm(), rested_N * share + kRounding) << loop.now - left;
  });
  EXPECT_EQ(loop.out.force_N, Vec3::Zero());
}

TEST(Leaving, springs) {
  Loop loop;
  for (std::int32_t i = 0; i < 4; ++i) start(loop, i, "spring", 5);
  leavesOnlyFalling(loop, {0.0002, 0, 0}, 0.0002 * kBound_N_per_m);
}

TEST(Leaving, fields_and_constraints_in_any_world) {
  for (const double scale : {0.1, 1.0, 10.0}) {
    SCOPED_TRACE(scale);
    Loop loop;
    loop.send(scene::SetHapticScale{scale});
    addField(loop, 90'000 / scale);  // more than one alone may have
    addConstraint(loop, 90'000 / scale);
    leavesOnlyFalling(loop, {0.0002, 0, 0}, 0.0002 * kBound_N_per_m);
  }
}

// Neither the spring nor the plane grows when the other counts no more.
TEST(Leaving, spring_beside_a_plane) {
  Loop loop;
  loop.send(scene::SetPlane{.plane = {0, 1, 0, 0}, .stiffness = 1, .damping = 0.004F});
  start(loop, 0, "spring", 9);
  loop.to({0, 0.001, 0});
  loop.to({0, -0.0001, 0});
  const Vec3 hip(0.0002, -0.0001, 0);
  const Vec3 before = loop.rest(hip, 100 * kMs).force_N;
  EXPECT_GT(before.x(), -0.0002 * 7000) << "beside the plane";
  const double plane_N = loop.out.contactForce_N.y();
  EXPECT_LT(plane_N, 0.08) << "beside the spring";
  loop.leave(1);
  loop.rest(hip, 400 * kMs, [&] {
    EXPECT_GE(loop.out.force_N.x(), before.x() - kRounding);
    EXPECT_LE(loop.out.contactForce_N.y(), plane_N + kRounding);
    EXPECT_EQ(loop.out.status, 0U);
  });
}

// One that was never felt, too: a client that sent all and broke off.
TEST(Leaving, before_anything_was_published) {
  Loop loop;
  for (std::int32_t i = 0; i < 4; ++i) start(loop, i, "spring", 5);
  loop.leave(1);
  double most_N = 0;
  loop.rest({0.0002, 0, 0}, 400 * kMs, [&] { most_N = std::max(most_N, loop.out.force_N.norm()); });
  EXPECT_LE(most_N, 0.0002 * kBound_N_per_m + kRounding);
}

// What another client has starts anew beside what ramps out.
TEST(Leaving, spring_of_another_is_as_stiff_as_alone) {
  Loop loop;
  start(loop, 0, "spring", 9);
  loop.rest({0.0002, 0, 0}, 100 * kMs);
  loop.leave(1);
  loop.send(scene::DefineEffect{.type = "spring", .index = 0, .gain = 9, .magnitude_N = 10}, 2);
  loop.send(scene::StartEffect{0}, 2);
  loop.rest({0.0002, 0, 0}, 400 * kMs);
  EXPECT_NEAR(loop.out.force_N.x(), -0.0002 * 9000, 1e-6);
}

using Start = void (*)(Loop& loop);

// At 0.03, 0.01 and 0 m, in the view of turnView().
const std::pair<const char*, Start> kForces[] = {
    {"constant",
     [](Loop& loop) {
       loop.send(scene::DefineEffect{.type = "constant", .magnitude_N = 2, .direction = {1, 0, 0}});
       loop.send(scene::StartEffect{0});
     }},
    {"spring",
     [](Loop& loop) {
       loop.send(scene::DefineEffect{
           .type = "spring", .gain = 0.5, .magnitude_N = 3, .position = inTurnedView({0.03, 0.01, 0})});
       loop.send(scene::StartEffect{0});
     }},
    {"friction", [](Loop& loop) { start(loop, 0, "friction", 0.5); }},
    {"field",
     [](Loop& loop) {
       loop.send(scene::SetForceField{.origin_m = inTurnedView({0.03, 0.01, 0}) / 1000,
                                      .force_N = {0.5, 0, 0},
                                      .jacobian_N_per_m = {-900, 20, 0, 0, -300, 0, 0, 0, 0},
                                      .radius_m = 0.01});
     }},
    {"point",
     [](Loop& loop) {
       loop.send(
           scene::SetConstraintVector{scene::ConstraintVector::point, inTurnedView({0.03, 0.01, 0}) / 1000});
       addConstraint(loop, 500);
     }},
    {"line",
     [](Loop& loop) {
       addConstraint(loop, 500);
       loop.send(scene::SetConstraintMode{2});
       loop.send(scene::SetConstraintVector{scene::ConstraintVector::linePoint,
                                            inTurnedView({0.03, 0.01, 0}) / 1000});
       loop.send(scene::SetConstraintVector{scene::ConstraintVector::lineDirection, {1, 1, 0}});
     }},
    {"plane of a constraint",
     [](Loop& loop) {
       addConstraint(loop, 500);
       loop.send(scene::SetConstraintMode{3});
       loop.send(scene::SetConstraintVector{scene::ConstraintVector::planePoint,
                                            inTurnedView({0.03, 0.01, 0}) / 1000});
       loop.send(scene::SetConstraintVector{scene::ConstraintVector::planeNormal, {1, 1, 0}});
     }},
    {"plane",
     [](Loop& loop) {
       const Vec3 normal = Vec3(-1, 0.5, 0).normalized();
       const double d = -normal.dot(inTurnedView({0.031, 0.01, 0})) / 1000;
       loop.send(scene::SetPlane{.plane = {normal.x(), normal.y(), normal.z(), d}, .stiffness = 0.6});
     }},
};

// The world has ended, and its view: the forces keep their place and direction on the device, whatever the
// view becomes.
TEST(Leaving, by_a_reset_in_place) {
  const std::pair<const char*, Start> views[] = {
      {"reset", [](Loop& loop) { loop.send(scene::ResetScene{}); }},
      {"reset and the same view again",
       [](Loop& loop) {
         loop.send(scene::ResetScene{});
         turnView(loop);
       }},
      {"reset on behalf of a client that left",
       [](Loop& loop) {
         loop.leave(1);
         loop.send(scene::ResetScene{});
       }},
      {"reset and a view some millimetres away",
       [](Loop& loop) {
         loop.send(scene::ResetScene{});
         loop.send(scene::SetHapticScale{0.5});
         loop.send(
             scene::SetHapticOrigin{.position_m = {0.012, 0.02, 0}, .axis = {0, 0, 1}, .angle_rad = 1.5});
       }},
      {"reset and new forces, and then a view",
       [](Loop& loop) {
         loop.send(scene::ResetScene{});
         loop.send(scene::DefineEffect{.type = "constant", .magnitude_N = 0});
         loop.send(scene::SetConstraintMode{0});
         loop.send(scene::SetForceField{});
         loop.send(scene::SetHapticScale{3});
       }},
  };
  for (const auto& [name, begin] : kForces) {
    for (const auto& [change, view] : views) {
      SCOPED_TRACE(std::string(name) + ", " + change);
      Loop loop;
      turnView(loop);
      loop.tick({0.029, 0.009, 0});
      begin(loop);
      loop.rest({0.029, 0.009, 0}, 10 * kMs);
      const Vec3 hip_m(0.0312, 0.0093, 0);
      const Vec3 before_N = loop.to(hip_m).force_N;
      ASSERT_GT(before_N.norm(), 0.05);
      view(loop);
      const Nanos left = loop.now + kMs;
      double off_N = 0;
      loop.rest(hip_m, 300 * kMs, [&] {
        const double share = std::max(0.0, 1 - base::toSeconds(loop.now - left) / 0.25);
        off_N = std::max(off_N, (loop.out.force_N - share * before_N).norm());
      });
      EXPECT_LT(off_N, 1e-6);
    }
  }
}

// A mass in a hand of 5 N s/m that moves when the client leaves: many dampers, each with all of the bound.
TEST(Leaving, dampers_do_not_shake_the_hand) {
  Loop loop;
  for (std::int32_t i = 0; i < 64; ++i) start(loop, i, "viscous", 0.005);
  constexpr double kMass_kg = 0.1;
  constexpr double kHand_Ns_per_m = 5;
  double x_m = 0;
  double v_m_per_s = 0.02;
  const auto step = [&] {
    const double force_N = std::clamp(loop.tick({x_m, 0, 0}).force_N.x(), -3.3, 3.3);
    v_m_per_s += (force_N - kHand_Ns_per_m * v_m_per_s) / kMass_kg * 1e-3;
    x_m += v_m_per_s * 1e-3;
  };
  step();
  step();
  loop.leave(1);
  for (int i = 0; i < 300; ++i) {
    const double speed = std::abs(v_m_per_s);
    step();
    ASSERT_LE(std::abs(v_m_per_s), speed + kRounding) << i;
  }
}

}  // namespace
}  // namespace hapticd::realtime::commands

// Forces without an object: effects, planes, force fields, the buzz.
#include <limits>

#include "base/time.h"
#include "realtime/render/effects.h"
#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

using scene::EffectType;

class FreeForcesTest : public VariantTest {
 protected:
  double units() const { return GetParam().worldUnitsPerMetre; }
  scene::Effect effect(EffectType type) const {
    scene::Effect e;
    e.type = type;
    e.gain = 500;
    e.magnitude_N = 1.5;
    e.angularFrequency_rad_per_s = 200;
    e.position = units() * offset();
    e.start = 1;
    return e;
  }
  void run(const scene::Effect& e) { scene.effects = {e}; }
  // Moves the view on the device, from that of the variant.
  void showView(const scene::Workspace& whole, const Affine& view) {
    scene.workspace.T_world_device = whole.T_world_device * view;
    scene.workspace.T_device_world = scene.workspace.T_world_device.inverse();
    hand->show(scene.snapshot());
  }
  // The same, moved along z of the variant's world, with or without a hand.
  void showViewOf(const scene::Workspace& whole, double z_m) {
    scene.workspace.T_world_device = whole.T_world_device * Affine(Eigen::Translation3d(0, 0, z_m));
    scene.workspace.T_device_world = scene.workspace.T_world_device.inverse();
    if (hand) hand->show(scene.snapshot());
  }
  void addTexture(double amplitude_m, double wavelength_m) {
    scene::Plane plane = floor(0);
    plane.textureAmplitude = units() * amplitude_m;
    plane.textureWavelength = units() * wavelength_m;
    scene.planes = {plane};
  }
  scene::Plane floor(double z_m) const {
    scene::Plane p;
    p.normal = Vec3::UnitZ();
    p.offset = -units() * (z_m + offset().z());
    p.surface = surface();
    p.placement = 1;
    return p;
  }
};
INSTANTIATE_TEST_SUITE_P(, FreeForcesTest, kVariants, variantName);

TEST_P(FreeForcesTest, constant_has_its_magnitude_in_any_unit) {
  scene::Effect e = effect(EffectType::constant);
  e.direction = Vec3(0, 3, 4);
  run(e);
  start({0, 0, 0});
  EXPECT_NEAR((hand->now().force_N - Vec3(0, 0.9, 1.2)).norm(), 0, 1e-12);
  e.direction = Vec3::Zero();
  run(e);
  start({0, 0, 0});
  EXPECT_EQ(hand->now().force_N.norm(), 0);
}

TEST_P(FreeForcesTest, spring_pulls_to_its_anchor_up_to_its_magnitude) {
  run(effect(EffectType::spring));
  start({0.001, 0, 0});
  EXPECT_NEAR((hand->now().force_N - Vec3(-0.5, 0, 0)).norm(), 0, 1e-9);
  EXPECT_NEAR((at({0, 0.01, 0}).force_N - Vec3(0, -1.5, 0)).norm(), 0, 1e-9);
}

TEST_P(FreeForcesTest, viscous_opposes_the_velocity) {
  scene::Effect e = effect(EffectType::viscous);
  e.gain = 5;
  run(e);
  start({0, 0, 0});
  EXPECT_NEAR((at({0.0001, 0, 0}).force_N - Vec3(-0.5, 0, 0)).norm(), 0, 1e-6);
  EXPECT_NEAR(at({0.0101, 0, 0}).force_N.norm(), 1.5, 1e-6);
}

TEST_P(FreeForcesTest, friction_drags_its_anchor_along) {
  run(effect(EffectType::friction));
  start({0, 0, 0});
  EXPECT_NEAR(to({0.002, 0, 0}).force_N.x(), -1.0, 1e-6);
  EXPECT_NEAR(to({0.010, 0, 0}).force_N.x(), -1.5, 1e-6);
  EXPECT_NEAR(to({0.007, 0, 0}).force_N.x(), 0, 1e-6);  // the anchor is 3 mm behind the turn
  EXPECT_NEAR(to({0.005, 0, 0}).force_N.x(), 1.0, 1e-6);
}

TEST_P(FreeForcesTest, friction_begins_where_the_hand_is_in_the_tick_in_which_it_begins) {
  for (const bool wasFriction : {true, false}) {
    scene::Effect e = effect(wasFriction ? EffectType::friction : EffectType::constant);
    e.gain = 0;
    run(e);
    start({0, 0, 0});
    at({0.001, 0, 0});
    run(effect(EffectType::friction));
    hand->show(scene.snapshot());
    EXPECT_EQ(at({0.003, 0, 0}).force_N.norm(), 0);
    EXPECT_NEAR(at({0.005, 0, 0}).force_N.x(), -1, 1e-9);
  }
}

TEST_P(FreeForcesTest, friction_of_hardly_any_gain_is_none) {
  scene::Effect rubbing = effect(EffectType::friction);
  rubbing.gain = 9990;
  rubbing.magnitude_N = 1000;
  scene::Effect push = effect(EffectType::constant);
  push.index = 1;
  push.direction = Vec3(0, 0, 1);
  scene.effects = {rubbing, push};
  start({0, 0, 0});
  EXPECT_NEAR(to({0.020, 0, 0}).force_N.x(), -199.8, 1e-6);
  for (const double gain : {3e-308, 1e-300}) {
    scene.effects[0].gain = gain;
    hand->show(scene.snapshot());
    EXPECT_EQ(at({0.020, 0, 0}).status & kRenderNotFinite, 0U) << "the other one goes on";
    EXPECT_NEAR((hand->now().force_N - Vec3(0, 0, 1.5)).norm(), 0, 1e-9);
  }
}

TEST_P(FreeForcesTest, motor_vibration_turns_with_the_stylus) {
  scene::Effect e = effect(EffectType::motorVibration);
  run(e);
  start({0, 0, 0});
  EXPECT_NEAR((hand->now().force_N - Vec3(1.5, 0, 0)).norm(), 0, 1e-12);
  for (int i = 1; i < 50; ++i) {
    const double phase = 200 * 1e-3 * i;
    EXPECT_NEAR((at({0, 0, 0}).force_N - 1.5 * Vec3(std::cos(phase), std::sin(phase), 0)).norm(), 0, 1e-9);
  }
  e.start = 2;
  for (const bool inDeviceFrame : {false, true}) {
    e.inDeviceFrame = inDeviceFrame;
    run(e);
    Hand turned(scene.snapshot());
    turned.orientation = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitY());
    const Vec3 expected = inDeviceFrame ? Vec3(1.5, 0, 0) : Vec3(0, 0, -1.5);
    EXPECT_NEAR((turned.at(Vec3::Zero()).force_N - expected).norm(), 0, 1e-9);
  }
}

TEST_P(FreeForcesTest, contact_vibration_only_while_touching) {
  run(effect(EffectType::contactVibration));
  add(plane(0.05, 10), surface());
  start({0.0013, 0.0021, 0.001});
  EXPECT_EQ(to({0.0013, 0.0021, 0.0005}).force_N.norm(), 0);
  const double phase = 200 * base::toSeconds(hand->time());
  EXPECT_NEAR(at({0.0013, 0.0021, -0.002}).force_N.z(), 2 + 1.5 * std::sin(phase), 1e-4);
}

// 1 N of the surface and vibrations of 1.5 N twice: the surface lets go at most, unless an option lets it
// pull.
TEST_P(FreeForcesTest, contact_vibration_does_not_pull) {
  scene::Effect e = effect(EffectType::contactVibration);
  scene.effects = {e, e};
  scene.effects[1].index = e.index + 1;
  add(plane(0.05, 10), surface());
  for (const bool pulls : {false, true}) {
    RenderOptions options;
    options.contactVibrationPulls = pulls;
    start({0.0013, 0.0021, 0.001}, options);
    at({0.0013, 0.0021, -0.001});
    double least = 1;
    for (int i = 0; i < 100; ++i) {
      const double phase = 200 * base::toSeconds(hand->time());
      const double force = at({0.0013, 0.0021, -0.001}).force_N.z();
      EXPECT_NEAR(force, pulls ? 1 + 3 * std::sin(phase) : std::max(0.0, 1 + 3 * std::sin(phase)), 1e-4);
      least = std::min(least, force);
    }
    EXPECT_NEAR(least, pulls ? -2 : 0, 0.05);
  }
}

// A sweep of the frequency: the angle is its integral, so no step of the force is larger than one of the
// angle.
TEST_P(FreeForcesTest, frequency_of_a_running_vibration_changes_without_a_jump) {
  scene::Effect e = effect(EffectType::motorVibration);
  run(e);
  start({0, 0, 0});
  double angle = 0;
  for (int i = 1; i < 400; ++i) {
    angle += e.angularFrequency_rad_per_s * 1e-3;
    e.angularFrequency_rad_per_s = 200 + 150 * std::sin(0.1 * i);
    run(e);
    hand->show(scene.snapshot());
    EXPECT_NEAR((at({0, 0, 0}).force_N - 1.5 * Vec3(std::cos(angle), std::sin(angle), 0)).norm(), 0, 1e-9);
  }
}

TEST_P(FreeForcesTest, effects_end_and_ramp_out) {
  scene::Effect e = effect(EffectType::constant);
  e.direction = Vec3::UnitX();
  e.duration = 10 * kTick;
  run(e);
  start({0, 0, 0});
  for (int i = 1; i < 20; ++i) EXPECT_NEAR(at({0, 0, 0}).force_N.x(), i < 10 ? 1.5 : 0, 1e-12);
  e.start = 2;
  e.duration = 0;
  run(e);
  start({0, 0, 0});
  scene.effects[0].releasing = true;
  hand->show(scene.snapshot());
  for (int i = 0; i < 300; ++i)
    EXPECT_NEAR(at({0, 0, 0}).force_N.x(), 1.5 * std::max(0.0, 1 - i / 250.0), 1e-9);
}

TEST_P(FreeForcesTest, as_many_effects_as_there_may_be_are_felt_beside_as_many_that_ramp_out) {
  scene.effects.clear();
  for (std::uint32_t i = 0; i < 64; ++i) {
    scene::Effect e = effect(EffectType::constant);
    e.index = static_cast<std::int32_t>(i);
    e.start = i + 1;
    e.magnitude_N = 0.01;
    e.direction = Vec3::UnitX();
    scene.effects.push_back(e);
  }
  start({0, 0, 0});
  EXPECT_NEAR(at({0, 0, 0}).force_N.x(), 0.64, 1e-9);
  for (scene::Effect& e : scene.effects) e.releasing = true;
  for (std::uint32_t i = 0; i < 64; ++i) {
    scene::Effect e = scene.effects[i];
    e.start += 64;
    e.direction = Vec3::UnitY();
    e.releasing = false;
    scene.effects.push_back(e);
  }
  hand->show(scene.snapshot());
  for (int i = 0; i < 300; ++i) {
    const Rendering& now = at({0, 0, 0});
    EXPECT_NEAR(now.force_N.x(), 0.64 * std::max(0.0, 1 - i / 250.0), 1e-9) << i;
    EXPECT_NEAR(now.force_N.y(), 0.64, 1e-9) << i;
  }
}

// A recording that begins keeps them in the memory of the servo.
TEST(EffectsMemory, has_room_for_all_that_do_not_ramp_out) {
  scene::SceneSnapshot scene;
  for (std::uint32_t i = 0; i < 128; ++i) {
    scene::Effect e;
    e.index = static_cast<std::int32_t>(i);
    e.start = i + 1;
    e.releasing = i >= 64;
    scene.effects.push_back(e);
  }
  Effects effects(false);
  effects.force(scene, {}, {}, 0, 0);
  RenderMemory memory;
  EXPECT_FALSE(effects.remember(memory)) << "some ramp out";
  EXPECT_LE(memory.effectCount, memory.effects.size());
  scene.effects.resize(64);
  effects.force(scene, {}, {}, 0, toNanos(0.001));
  EXPECT_TRUE(effects.remember(memory));
  EXPECT_EQ(memory.effectCount, 64U);
}

// The scene thread is busy: no snapshot shows that the owner is gone.
TEST_P(FreeForcesTest, forces_ramp_out_when_their_owner_is_gone_though_no_snapshot_shows_it) {
  const auto owner = std::make_shared<scene::ForceOwner>();
  scene::Effect e = effect(EffectType::constant);
  e.direction = Vec3::UnitX();
  e.owner = owner;
  run(e);
  scene::ForceField field;
  field.origin = units() * offset();
  field.force_N = Vec3(0, 1, 0);
  field.radius = units();
  field.owner = owner;
  scene.fields = {field};
  scene.buzz = scene::Buzz{.force_N = Vec3(0, 0, 1),
                           .angularFrequency_rad_per_s = 0,
                           .duration = toNanos(9),
                           .start = 1,
                           .owner = owner};
  scene.buzz->angularFrequency_rad_per_s = M_PI * 500;  // every other tick at a peak, to either side
  scene.planes = {floor(0.001)};
  scene.planes[0].owner = owner;
  start({0, 0, 0});
  EXPECT_TRUE(hand->now().touching || at({0, 0, 0.0009}).touching);
  owner->leave(hand->time());               // that of the next tick
  owner->leave(hand->time() + toNanos(1));  // the first time counts
  for (int i = 1; i <= 260; ++i) {
    const Rendering& now = at({0, 0, 0});
    const double left = std::clamp(1 - (i - 51) / 200.0, 0.0, 1.0);
    EXPECT_NEAR(now.force_N.x(), 1.5 * left, 1e-9) << i;
    EXPECT_NEAR(now.force_N.y(), 1 * left, 1e-9) << i;
    if (i >= 251) {
      EXPECT_EQ(now.force_N.norm(), 0) << i;
    }
  }
}

// In time, its release alone counts, as in a recording that is rendered again. Late, the force goes on
// falling.
TEST_P(FreeForcesTest, a_release_by_the_scene_joins_the_one_by_the_owner) {
  for (const int late : {20, 100}) {
    const auto owner = std::make_shared<scene::ForceOwner>();
    scene::Effect e = effect(EffectType::constant);
    e.direction = Vec3::UnitX();
    e.owner = owner;
    run(e);
    start({0, 0, 0});
    owner->leave(hand->time());
    for (int i = 1; i < 400; ++i) {
      if (i == late) {
        scene.effects[0].releasing = true;
        hand->show(scene.snapshot());
      }
      const double bySnapshot = i < late ? 1 : std::max(0.0, 1 - (i - late) / 250.0);
      const double byOwner = late <= 50 ? 1 : std::clamp(1 - (i - 51) / 200.0, 0.0, 1.0);
      EXPECT_NEAR(at({0, 0, 0}).force_N.x(), 1.5 * std::min(bySnapshot, byOwner), 1e-9) << late << " " << i;
    }
  }
}

// A start of a running effect restarts its phase and its duration.
TEST_P(FreeForcesTest, restart_begins_anew) {
  scene::Effect e = effect(EffectType::motorVibration);
  e.duration = 10 * kTick;
  run(e);
  start({0, 0, 0});
  for (int i = 1; i < 6; ++i) EXPECT_NEAR(at({0, 0, 0}).force_N.x(), 1.5 * std::cos(0.2 * i), 1e-9);
  e.start = 2;
  run(e);
  hand->show(scene.snapshot());
  for (int i = 0; i < 15; ++i)
    EXPECT_NEAR(at({0, 0, 0}).force_N.x(), i < 10 ? 1.5 * std::cos(0.2 * i) : 0, 1e-9);
}

// A plane of the scene and a wall of triangles form a corner as two walls do.
TEST_P(FreeForcesTest, plane_and_mesh_make_a_corner) {
  scene.planes = {floor(0)};
  TriangleMesh wall;
  wall.vertices = {{0, -0.05F, -0.05F}, {0, 0.05F, -0.05F}, {0, 0.05F, 0.05F}, {0, -0.05F, 0.05F}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  add(wall, surface());
  start({0.003, 0.0107, 0.003});
  const Rendering& r = at({-0.001, 0.0107, -0.002});
  EXPECT_NEAR((r.force_N - Vec3(1, 0, 2)).norm(), 0, 1e-5);
  EXPECT_EQ(r.touchedObject, -1);
  EXPECT_EQ(r.status, 0U);
}

TEST_P(FreeForcesTest, plane_has_friction_and_lateral_adhesion) {
  scene::Plane p = floor(0);
  p.surface = surface(1000, 0.5, 0.5);
  p.adhesionLateral_N = 0.4;
  scene.planes = {p};
  start({0, 0, 0.001});
  to({0, 0, -0.001});
  EXPECT_NEAR(to({0.0005, 0, -0.001}).force_N.x(), -0.5, 1e-4);
  EXPECT_NEAR(to({0.01, 0, -0.001}).force_N.x(), -0.9, 1e-3);
}

// recovery  a plane placed 2 mm above the HIP rises under it within 100 ms
TEST_P(FreeForcesTest, new_plane_comes_in_under_the_hand) {
  start({0, 0, -0.002});
  scene::Plane p = floor(0);
  p.recovery = toNanos(0.1);
  scene.planes = {p};
  hand->show(scene.snapshot());
  for (int i = 0; i < 150; ++i) {
    EXPECT_NEAR(at({0, 0, -0.002}).force_N.z(), 2.0 * std::min(1.0, i / 100.0), 1e-4);
    EXPECT_EQ(hand->now().status, 0U);
  }
  scene.planes[0].placement = 2;
  scene.planes[0].recovery = 0;
  scene.planes[0].offset -= units() * 0.001;
  hand->show(scene.snapshot());
  EXPECT_NEAR(at({0, 0, -0.002}).force_N.z(), 2.0, 1e-4) << "what was felt before stays";
  EXPECT_NEAR(at({0, 0, -0.002}).force_N.z(), 3.0, 1e-4) << "and the rest rises at 1 m/s";
  EXPECT_EQ(hand->now().status, 0U);
}

// As with solids, a hand that a plane was put around by a command is not thrown out of it.
TEST_P(FreeForcesTest, plane_placed_far_above_the_hand_is_left_out_until_the_hand_has_left_it) {
  for (const double depth_m : {0.019, 0.021}) {
    scene.planes.clear();
    start({0, 0, 0});
    scene.planes = {floor(depth_m)};
    hand->show(scene.snapshot());
    for (int i = 0; i < 30; ++i) at({0, 0, 0});
    EXPECT_EQ(hand->now().force_N.z() > 0, depth_m < 0.02) << depth_m;
    EXPECT_EQ(hand->now().status & kRenderEnclosed, depth_m < 0.02 ? 0U : kRenderEnclosed);
    to({0, 0, 0.03}, 0.1);
    EXPECT_GT(to({0, 0, depth_m - 0.001}, 0.1).force_N.z(), 0.5) << depth_m;
  }
}

// Clients stream planes that are tangent to a surface of their own. The motion of the hand is not the
// plane's.
TEST_P(FreeForcesTest, plane_placed_anew_in_each_tick_is_as_stiff_as_one_at_rest) {
  constexpr double kDepth_m = 0.002;
  scene::Plane plane = floor(0);
  const double wanted_N = kDepth_m * plane.surface.stiffness_N_per_m;
  for (const Nanos recovery : {1 * kTick, 10 * kTick, 1000 * kTick}) {
    scene.planes = {plane};
    start({0, 0, 0.001});
    const auto place = [&](const Rendering&) {
      ++plane.placement;
      plane.recovery = recovery;
      plane.offset += units() * (plane.placement % 2 == 0 ? 1e-9 : -1e-9);
      scene.planes = {plane};
      hand->show(scene.snapshot());
    };
    to({0, 0, -kDepth_m}, 0.05, place);
    EXPECT_NEAR(hand->now().force_N.z(), wanted_N, 1e-3 * wanted_N) << recovery / kTick;
  }
}

TEST_P(FreeForcesTest, view_that_jumps_with_a_touched_plane_leaves_the_hand_to_itself) {
  scene.planes = {floor(0)};
  const scene::Workspace whole = scene.workspace;
  for (const double jump_m : {0.019, 0.021, 0.5}) {
    SCOPED_TRACE(jump_m);
    showViewOf(whole, 0);
    start({0, 0, 0.001});
    to({0, 0, -0.001});
    EXPECT_GT(hand->now().force_N.z(), 0);
    showViewOf(whole, -jump_m);
    const bool isLeftOut = (at({0, 0, -0.001}).status & kRenderEnclosed) != 0;
    EXPECT_EQ(isLeftOut, jump_m > 0.020);
    EXPECT_EQ(hand->now().force_N.norm() > 0, jump_m < 0.020);
    to({0, 0, jump_m + 0.001});
    EXPECT_GT(to({0, 0, jump_m - 0.001}).force_N.z(), 0) << "felt again once the hand has left it";
  }
}

// adhesion  goes on holding while the plane moves, and ends with a report when it is switched off
TEST_P(FreeForcesTest, adhesion_outlives_a_new_placement) {
  scene.planes = {floor(0)};
  scene.planes[0].adhesionNormal_N = 1.5;
  start({0, 0, 0.001});
  to({0, 0, -0.001});
  const double pull_N = to({0, 0, 0.001}).force_N.z();
  EXPECT_LT(pull_N, -0.5);
  scene.planes[0].placement = 2;
  scene.planes[0].offset += units() * 1e-6;
  hand->show(scene.snapshot());
  EXPECT_NEAR(at({0, 0, 0.001}).force_N.z(), pull_N, 0.01);
  scene.planes[0].adhesionNormal_N = 0;
  hand->show(scene.snapshot());
  EXPECT_NEAR(at({0, 0, 0.001}).force_N.z(), 0, 1e-9);
  EXPECT_NE(hand->now().status & kRenderGeometryJump, 0U) << "blended by the guard";
}

TEST_P(FreeForcesTest, plane_holds_on_up_to_its_adhesion) {
  scene::Plane p = floor(0);
  p.adhesionNormal_N = 0.5;
  scene.planes = {p};
  start({0, 0, 0.0003});
  EXPECT_EQ(hand->now().force_N.norm(), 0);
  EXPECT_NEAR(to({0, 0, -0.001}).force_N.z(), 1, 1e-4);
  EXPECT_NEAR(to({0, 0, 0.0004}).force_N.z(), -0.4, 1e-4);
  EXPECT_EQ(to({0, 0, 0.0006}).force_N.norm(), 0);
  EXPECT_EQ(to({0, 0, 0.0003}).force_N.norm(), 0);
}

// The wave stays where the first contact put it until the hand is above its crests.
TEST_P(FreeForcesTest, texture_waits_below_a_hand_that_leaves_a_trough) {
  scene::Plane p = floor(0);
  p.textureAmplitude = units() * 0.0005;
  p.textureWavelength = units() * 0.010;
  scene.planes = {p};
  start({0, 0, 0.002});
  to({0, 0, -0.001}, 0.05);
  ASSERT_NEAR(to({0.005, 0, -0.001}, 0.05).force_N.z(), 0.5, 0.01);
  for (double z = -0.001; z < 0.0004; z += 2e-5) {
    const double depth_m = std::max(0.0, -0.0005 - z);
    EXPECT_NEAR(at({0.005, 0, z}).force_N.z(), 1000 * depth_m, 0.01) << z;
  }
  to({0.005, 0, 0.001}, 0.05);
  EXPECT_NEAR(to({0.005, 0, 0.0003}, 0.05).force_N.z(), 0.2, 0.01) << "met anew, a crest";
}

TEST_P(FreeForcesTest, texture_and_buzz_move_the_plane) {
  scene::Plane p = floor(0);
  p.textureAmplitude = units() * 0.0002;
  p.textureWavelength = units() * 0.002;
  scene.planes = {p};
  start({0, 0, 0.001});
  EXPECT_NEAR(to({0, 0, -0.001}, 0.01).force_N.z(), 1.2, 1e-3);
  EXPECT_NEAR(to({0.001, 0, -0.001}, 0.01).force_N.z(), 0.8, 1e-3);
  EXPECT_NEAR(to({0.002, 0, -0.001}, 0.01).force_N.z(), 1.2, 1e-2);
  p.textureWavelength = 0;
  p.buzzAmplitude = units() * 0.0001;
  p.buzzAngularFrequency_rad_per_s = 300;
  scene.planes = {p};
  start({0, 0, 0.001});
  for (int i = 1; i < 40; ++i) {
    EXPECT_NEAR(at({0, 0, -0.001}).force_N.z(), 1 + 0.1 * std::sin(0.3 * i), 1e-4);
  }
}

// Stock clients send the plane below the hand again and again.
TEST_P(FreeForcesTest, buzz_goes_on_while_its_plane_is_placed_anew) {
  scene::Plane p = floor(0);
  p.buzzAmplitude = units() * 0.0001;
  p.buzzAngularFrequency_rad_per_s = 300;
  scene.planes = {p};
  start({0, 0, 0.001});
  for (int i = 1; i < 200; ++i) {
    if (i > 40 && i % (i < 120 ? 7 : 1) == 0) {
      ++p.placement;
      scene.planes = {p};
      hand->show(scene.snapshot());
    }
    EXPECT_NEAR(at({0, 0, -0.001}).force_N.z(), 1 + 0.1 * std::sin(0.3 * i), 1e-4) << i;
  }
}

// A client that takes them for millimetres, or sends what it never set: the plane does not lift the hand
// across the workspace.
TEST_P(FreeForcesTest, texture_and_buzz_raise_the_plane_by_at_most_10_mm) {
  constexpr double kPressed_m = 0.001;
  for (const double amplitude_m : {0.011, 0.5, 1e15, 1e27}) {
    SCOPED_TRACE(amplitude_m);
    scene::Plane p = floor(0);
    scene.planes = {p};
    start({0, 0, 0.001});
    to({0, 0, -kPressed_m});
    p.textureAmplitude = units() * amplitude_m;
    p.textureWavelength = units() * 1e6;
    scene.planes = {p};
    hand->show(scene.snapshot());
    EXPECT_NEAR(at({0, 0, -kPressed_m}).force_N.z(), 1000 * (0.010 + kPressed_m), 1e-3);
    EXPECT_NEAR(at({0.001, 0, -kPressed_m}).force_N.z(), 1000 * (0.010 + kPressed_m), 1e-3);
    EXPECT_TRUE(hand->now().proxy_m.allFinite());
    EXPECT_NEAR(to({0.001, 0, 0.011}).force_N.z(), 0, 1e-6) << "above the crest";
    p.textureAmplitude = p.textureWavelength = 0;
    p.buzzAmplitude = units() * amplitude_m;
    p.buzzAngularFrequency_rad_per_s = 300;
    scene.planes = {p};
    start({0, 0, 0.012});
    to({0, 0, 0});
    double most_N = 0;
    for (int i = 0; i < 100; ++i) most_N = std::max(most_N, at({0, 0, 0}).force_N.z());
    EXPECT_NEAR(most_N, 10, 0.1);
    EXPECT_TRUE(hand->now().proxy_m.allFinite());
  }
}

// A view that moves, streamed at 60 Hz, with a hand that moves with it: in the world nothing moves.
TEST_P(FreeForcesTest, what_holds_the_hand_moves_with_the_view) {
  for (const char* const what : {"friction", "adhesion", "texture", "friction effect", "corner"}) {
    scene.planes.clear();
    scene.effects.clear();
    scene::Plane plane = floor(0);
    if (what == std::string("friction") || what == std::string("corner"))
      plane.surface = surface(1000, 0.6, 0.5);
    if (what == std::string("corner"))
      add(box({0.003, -0.05, -0.05}, {0.05, 0.05, 0.05}), surface(1000, 0.5, 0.4));
    if (what == std::string("adhesion")) plane.adhesionLateral_N = 0.5;
    if (what == std::string("texture")) {
      plane.textureAmplitude = 0.0003 * units();
      plane.textureWavelength = 0.003 * units();
    }
    if (what == std::string("friction effect")) {
      run(effect(EffectType::friction));
    } else {
      scene.planes = {plane};
    }
    start({0.0028, 0.002, 0.002});
    const Vec3 place(0.0034, 0.0025, -0.001);
    to(place);
    const Vec3 force = at(place).force_N;
    EXPECT_GT(force.norm(), 0.1) << what;
    const scene::Workspace whole = scene.workspace;
    Affine view = Affine::Identity();  // the way of the view in device metres
    for (int i = 0; i < 300; ++i) {
      if (i % 16 == 0) {
        view = Eigen::Translation3d(offset()) * Eigen::AngleAxisd(1e-4 * i, Vec3(0.6, 0, 0.8)) *
               Eigen::Translation3d(Vec3(3e-6 * i, 1e-5 * i, 0) - offset());
        showView(whole, view);
      }
      const Vec3 felt = view.linear() * hand->at(view.inverse() * (place + offset())).force_N;
      ASSERT_LT((felt - force).norm(), 2e-3) << what << " " << i;
    }
    scene.workspace = whole;
  }
}

// The hand stays where it is on the device.
TEST_P(FreeForcesTest, view_that_jumps_leaves_textures_to_the_hand) {
  addTexture(0.0005, 0.007);
  start({0, 0, 0.002});
  to({0.001, 0, -0.002});
  const Vec3 force = at({0.001, 0, -0.002}).force_N;
  showView(scene::Workspace(scene.workspace), Affine(Eigen::Translation3d(0.025, 0, 0)));
  for (int i = 0; i < 5; ++i) EXPECT_LT((at({0.001, 0, -0.002}).force_N - force).norm(), 1e-3) << i;
}

// It is no kick of the hand, so the guard is told, and blends.
TEST_P(FreeForcesTest, view_that_steps_below_a_texture_is_a_jump_of_the_geometry) {
  addTexture(0.0005, 0.007);
  start({0, 0, 0.002});
  to({0, 0, -0.002});
  Vec3 force = at({0, 0, -0.002}).force_N;
  showView(scene::Workspace(scene.workspace), Affine(Eigen::Translation3d(0.0035, 0, 0)));
  for (int i = 0; i < 5; ++i) {
    const Rendering& r = at({0, 0, -0.002});
    if ((r.force_N - force).norm() > 0.1) {
      EXPECT_NE(r.status & kRenderGeometryJump, 0U) << i;
    }
    force = r.force_N;
  }
}

TEST_P(FreeForcesTest, texture_does_not_brake_the_hand) {
  addTexture(0.0003, 0.004);
  start({0, 0, 0.001}, RenderOptions{.bareDamping_Ns_per_m = 0.1});
  to({0, 0, -0.002});
  to({0.04, 0, -0.002}, 0.2, [&](const Rendering& r) { EXPECT_EQ(r.force_N, r.contactForce_N); });
}

// Without dynamic friction a slide goes on without a force; it must not stick anew in each tick.
TEST_P(FreeForcesTest, surface_that_moves_and_has_static_friction_alone_does_not_shake) {
  scene.planes = {floor(0)};
  scene.planes[0].surface = surface(1000, 0.5, 0);
  start({0, 0, 0.001});
  to({0, 0, -0.002});
  const scene::Workspace whole = scene.workspace;
  double most = 0;
  for (int i = 1; i < 300; ++i) {
    showView(whole, Affine(Eigen::Translation3d(0, 2e-5 * i, 0)));
    const Vec3 before = hand->now().force_N;
    const Vec3 after = at({5e-5 * i, 0, -0.002}).force_N;
    if (i > 100) most = std::max(most, (after - before).norm());
  }
  EXPECT_LT(most, 0.05);
}

TEST_P(FreeForcesTest, field_varies_from_its_origin_within_its_radius) {
  scene::ForceField field;
  field.origin = units() * offset();
  field.force_N = Vec3(0, 0, 0.2);
  field.jacobian_N_per_unit = Vec3(-100, -200, 0).asDiagonal();
  field.jacobian_N_per_unit /= units();
  field.radius = units() * 0.01;
  scene.fields = {field};
  start({0.002, 0.001, 0});
  EXPECT_NEAR((hand->now().force_N - Vec3(-0.2, -0.2, 0.2)).norm(), 0, 1e-9);
  EXPECT_EQ(at({0.0101, 0, 0}).force_N.norm(), 0);
  scene.fields[0].releasing = true;
  hand->show(scene.snapshot());
  for (int i = 0; i < 300; ++i) {
    EXPECT_NEAR(at({0, 0, 0}).force_N.z(), 0.2 * std::max(0.0, 1 - i / 250.0), 1e-9);
  }
}

//  |F| ________
//              \        full up to 90 % of the radius, then linear to zero
//  ____________|\____ r
TEST_P(FreeForcesTest, field_fades_at_its_rim_and_stays_below_ten_newtons) {
  scene::ForceField field;
  field.origin = units() * offset();
  field.force_N = Vec3(0, 0, 2);
  field.radius = units() * 0.01;
  scene.fields = {field};
  start({0.0089, 0, 0});
  EXPECT_NEAR(hand->now().force_N.z(), 2, 1e-9);
  EXPECT_NEAR(at({0.0095, 0, 0}).force_N.z(), 1, 1e-6);
  EXPECT_NEAR(at({0, 0.0099, 0}).force_N.z(), 0.2, 1e-6);
  EXPECT_NEAR(at({0, 0.00999999, 0}).force_N.z(), 0, 1e-4);
  scene.fields[0].force_N = Vec3(0, 30, 40);
  hand->show(scene.snapshot());
  EXPECT_NEAR((at({0, 0, 0}).force_N - Vec3(0, 6, 8)).norm(), 0, 1e-9);
}

TEST_P(FreeForcesTest, buzz_runs_for_its_duration) {
  scene::Buzz buzz;
  buzz.force_N = Vec3(0, 1, 0);
  buzz.angularFrequency_rad_per_s = 500;
  buzz.duration = 20 * kTick;
  buzz.start = 3;
  scene.buzz = buzz;
  start({0, 0, 0});
  for (int i = 1; i < 40; ++i) {
    EXPECT_NEAR(at({0, 0, 0}).force_N.y(), i < 20 ? std::sin(0.5 * i) : 0.0, 1e-9);
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture

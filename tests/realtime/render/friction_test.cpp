// Coulomb friction: T3, T9b, T12 (without friction, for the energy) and T19 of the ground truth.
#include <random>

#include "base/time.h"
#include "reduced.h"
#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

class FrictionTest : public VariantTest {};
INSTANTIATE_TEST_SUITE_P(, FrictionTest, kVariants, variantName);

double lateral(const Rendering& r) {
  return r.force_N.head<2>().norm();
}

// T3     o ->  2 mm deep, 10 mm/s: sticks until the spring is 1.00 mm long, then slides with mu_d
//     =======
TEST_P(FrictionTest, ramp_sticks_then_slides) {
  add(plane(0.05, 40), surface(1000, 0.5, 0.3));
  start({0.00013, 0.0002, 0.0005});
  to({0.00013, 0.0002, -0.002});
  const Vec3 held = proxy();
  double slipAt = -1;
  double work = 0;
  Vec3 last = hip();
  Vec3 lastForce = hand->now().force_N;
  to({0.01013, 0.0002, -0.002}, 0.01, [&](const Rendering& r) {
    const double shift = hip().x() - held.x();
    EXPECT_NEAR(r.force_N.z(), 2.0, 1e-4);
    EXPECT_LE(lateral(r), 0.5 * 2.0 * 1.001);
    if (slipAt < 0 && proxy().x() - held.x() > 1e-6) slipAt = shift;
    if (slipAt < 0) {
      EXPECT_NEAR(r.force_N.x(), -1000 * shift, 1e-4);
    } else {
      EXPECT_NEAR(lateral(r) / r.force_N.z(), 0.3, 0.006);
    }
    work += 0.5 * (r.force_N + lastForce).dot(hip() - last);
    last = hip();
    lastForce = r.force_N;
  });
  EXPECT_NEAR(slipAt, 0.001, 0.00002);
  EXPECT_LT(work, 0);
}

// After a reversal the proxy sticks at once, and the spring passes through zero without a step.
TEST_P(FrictionTest, reversal_sticks) {
  add(plane(0.05, 40), surface(1000, 0.5, 0.3));
  start({0.00013, 0.0002, 0.0005});
  to({0.00013, 0.0002, -0.002});
  to({0.00513, 0.0002, -0.002}, 0.01);
  const Vec3 held = proxy();
  double last = hand->now().force_N.x();
  to({0.00383, 0.0002, -0.002}, 0.01, [&](const Rendering& r) {
    EXPECT_NEAR((proxy() - held).norm(), 0, 1e-6);
    EXPECT_NEAR(r.force_N.x() - last, 0.01, 1e-3);
    last = r.force_N.x();
  });
  EXPECT_GT(last, 0);
}

// A reversal within one tick to a length between both limits ends the slide: the proxy sticks.
TEST_P(FrictionTest, reversal_within_a_tick_sticks) {
  add(plane(0.05, 10), surface(1000, 0.5, 0.3));
  start({0.0003, 0.0002, 0.001});
  to({0.0003, 0.0002, -0.001});
  EXPECT_NEAR(to({0.0053, 0.0002, -0.001}).force_N.x(), -0.3, 1e-3);
  EXPECT_NEAR(at({0.0046, 0.0002, -0.001}).force_N.x(), 0.4, 1e-3);
}

// T19    mu 0.6 | mu 0.1     two abutting plates; only the friction changes at the seam
//      =========|=========
TEST_P(FrictionTest, seam_between_objects_changes_friction_without_a_kick) {
  const auto plate = [](double from, double to) {
    TriangleMesh mesh;
    mesh.vertices = {Vec3(from, -0.02, 0).cast<float>(), Vec3(to, -0.02, 0).cast<float>(),
                     Vec3(to, 0.02, 0).cast<float>(), Vec3(from, 0.02, 0).cast<float>()};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
  };
  add(plate(-0.02, 0), surface(1000, 0.6, 0.6));
  add(plate(0, 0.02), surface(1000, 0.1, 0.1));
  start({-0.01, 0.0003, 0.001});
  to({-0.01, 0.0003, -0.001});
  double before = 0;
  double after = 0;
  to({0.01, 0.0003, -0.001}, 0.02, [&](const Rendering& r) {
    EXPECT_NEAR(r.normalForce_N.z(), 1.0, 1e-3);
    EXPECT_NEAR(r.normalForce_N.head<2>().norm(), 0, 1e-6);
    EXPECT_EQ(r.touchedObject, proxy().x() > 1e-6 ? 1 : r.touchedObject);
    if (proxy().x() < -1e-5) before = lateral(r);
    if (proxy().x() > 1e-3) after = lateral(r);
  });
  EXPECT_NEAR(before, 0.6, 0.012);
  EXPECT_NEAR(after, 0.1, 0.002);
}

// T9b   a plate slides under a pressed HIP: it takes the proxy along up to the cone, then the proxy slips
//          o
//     ==========  ->
TEST_P(FrictionTest, sliding_plate_carries_the_proxy_until_it_slips) {
  scene::ObjectState& object = add(plane(0.05, 10), surface(1000, 0.5, 0.5));
  Affine end = object.motion.destination();
  end.pretranslate(Vec3(0.01 * GetParam().worldUnitsPerMetre, 0, 0));
  const Nanos begin = toNanos(0.1);
  object.motion = scene::Motion::between(object.motion.origin(), end, begin, begin + toNanos(0.2));
  start({0.001, 0.002, 0.001});
  to({0.001, 0.002, -0.002});
  bool slipped = false;
  for (int i = 0; i < 300; ++i) {
    const Nanos now = hand->time();
    const Rendering& r = at({0.001, 0.002, -0.002});
    const double moved = 0.05 * base::toSeconds(std::clamp<Nanos>(now - begin, 0, toNanos(0.2)));
    EXPECT_NEAR(r.force_N.z(), 2.0, 1e-4);
    EXPECT_NEAR(r.force_N.x(), 1000 * std::min(moved, 0.001), 0.02);
    slipped = slipped || moved > 0.001;
  }
  EXPECT_TRUE(slipped);
}

// Friction bears what the damper leaves of the pressure. The expected spring along a floor is cut to that in
// each tick, and what was cut is gone.
TEST_P(FrictionTest, slips_where_the_damper_takes_the_pressure) {
  std::mt19937 random(1);
  const auto number = [&random](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  const int floors = reduced(40);
  for (int floor = 0; floor < floors; ++floor) {
    scene::Surface s = surface(number(100, 2000));
    s.damping_Ns_per_m = number(0, 2);
    s.staticFriction = s.dynamicFriction = number(0.1, 1.2);
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    add(plane(0.1, 10), s);
    start({0.0003, 0.0002, 0.001});
    Vec3 sideways = Vec3::Zero();
    Vec3 last = hip();
    double missed_N = 0;
    double share = 1;
    for (int stroke = 0; stroke < 10; ++stroke) {
      const Vec3 end(number(-0.01, 0.01), number(-0.01, 0.01), number(-0.003, -0.0001));
      to(end, number(0.02, 0.5), [&](const Rendering& r) {
        const Vec3 move = hip() - last;
        last = hip();
        const double spring_N = -s.stiffness_N_per_m * hip().z();
        if (spring_N <= 1e-6) return;
        const double pressed_N = std::max(0.0, spring_N - s.damping_Ns_per_m * move.z() / 1e-3);
        const double bound_m = s.staticFriction * std::min(spring_N, pressed_N) / s.stiffness_N_per_m;
        sideways -= Vec3(move.x(), move.y(), 0);
        if (sideways.norm() > bound_m) sideways = bound_m * sideways.normalized();
        const Vec3 expected_N = pressed_N * Vec3::UnitZ() + s.stiffness_N_per_m * sideways;
        missed_N = std::max(missed_N, (r.force_N - expected_N).norm());
        share = std::min(share, hand->renderer().energyShare());
      });
      ASSERT_LT(missed_N, 2e-4) << "floor " << floor << ", stroke " << stroke;
      ASSERT_EQ(share, 1) << "floor " << floor << ", stroke " << stroke;
    }
  }
}

// T12  press, slide, return and release on a bumpy sphere without friction: no energy is gained. (Some may be
// lost: on a convex edge the proxy stays on its face until it runs over the edge.)
TEST_P(FrictionTest, closed_loop_on_a_bumpy_sphere_gives_no_energy) {
  TriangleMesh mesh = sphere(0.04, 100);
  for (auto& v : mesh.vertices) {
    const Vec3 d = v.cast<double>().normalized();
    v = (d * (0.04 + 0.0004 * std::sin(20 * d.x()) * std::sin(17 * d.y()) * std::sin(23 * d.z())))
            .cast<float>();
  }
  add(mesh, surface());
  const auto onSphere = [](double radius, double angle) {
    return Vec3(radius * std::cos(0.3) * std::cos(angle), radius * std::cos(0.3) * std::sin(angle),
                radius * std::sin(0.3));
  };
  constexpr double kDepth = 0.002;
  start(onSphere(0.042, 0));
  double work = 0;
  Vec3 last = hip();
  Vec3 lastForce = Vec3::Zero();
  const auto measure = [&](const Rendering& r) {
    work += 0.5 * (r.force_N + lastForce).dot(hip() - last);
    last = hip();
    lastForce = r.force_N;
  };
  to(onSphere(0.04 - kDepth, 0), 0.02, measure);
  for (int i = 1; i <= 500; ++i) to(onSphere(0.04 - kDepth, i * 2e-3), 0.1, measure);
  for (int i = 499; i >= 0; --i) to(onSphere(0.04 - kDepth, i * 2e-3), 0.1, measure);
  to(onSphere(0.042, 0), 0.02, measure);
  EXPECT_LE(work, 0.01 * 0.5 * 1000 * kDepth * kDepth);
}

}  // namespace
}  // namespace hapticd::realtime::fixture

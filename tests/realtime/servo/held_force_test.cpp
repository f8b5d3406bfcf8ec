// The law of held forces against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/time.h"
#include "realtime/remote/held_force.h"
#include "realtime/remote/remote_input.h"
#include "realtime/servo/remote_rig.h"

namespace hapticd::realtime {
namespace {

struct Holding {
  HeldForceLaw law;
  HeldForce wanted;
  RemoteRendering out;
  Vec3 hip = Vec3::Zero();
  Vec3 velocity = Vec3::Zero();
  Nanos now = 1000 * kMs;
  double gain = 1;

  void hold(const Vec3& force_N, Nanos lifetime = 100 * kMs) {
    ++wanted.number;
    wanted.received = now;
    wanted.lifetime = lifetime;
    wanted.force_N = force_N;
  }
  Vec3 step() {
    now += kMs;
    hip += 1e-3 * velocity;
    out = {};
    law.step(wanted, hip, velocity, now, 1e-3, gain, out);
    return out.heldForce_N;
  }
};

TEST(HeldForce, RisesAtTheRateAndIsZeroAtTheEndOfItsLife) {
  Holding h;
  h.hold({0, 3, 0});
  Vec3 last = Vec3::Zero();
  double largest = 0;
  for (int ms = 1; ms <= 100; ++ms) {
    const Vec3 force = h.step();
    EXPECT_LE((force - last).norm(), kRate_N_per_ms + kExact_N);
    largest = std::max(largest, force.y());
    last = force;
  }
  EXPECT_DOUBLE_EQ(largest, 3);
  EXPECT_NEAR(last.y(), 0, 1e-6);
  EXPECT_EQ(h.step().y(), 0);
}

TEST(HeldForce, TankLimitsTheWorkAndTheBrakingPartStays) {
  Holding h;
  h.velocity = {0, 0.2, 0};
  double work = 0;
  int cutAt = -1;
  int zeroAt = -1;
  for (int ms = 0; ms < 2000; ++ms) {
    if (ms % 20 == 0) h.hold({1, 2, 0});
    const Vec3 before = h.out.heldForce_N;
    const Vec3 force = h.step();
    work += before.y() * 0.2e-3;
    if (cutAt < 0 && (h.out.status & kRemoteEnergySpent) != 0) cutAt = ms;
    if (cutAt >= 0 && zeroAt < 0 && std::abs(force.y()) < 1e-9) zeroAt = ms;
    if (zeroAt == ms) {
      EXPECT_NEAR(force.x(), 1, 1e-9) << "across the motion nothing is cut";
    }
    if (ms == 100) {
      EXPECT_NE(h.out.status & kRemoteEnergySpent, 0U);
    }
  }
  ASSERT_GE(cutAt, 0);
  ASSERT_GE(zeroAt, 0);
  EXPECT_LE(zeroAt - cutAt, 10);
  EXPECT_LT(work, 0.020 + 2 * 0.020 + 0.005)
      << "the start, the refill of two seconds, and what one cut takes";
}

TEST(HeldForce, WhatTheHandReturnsRefillsTheTank) {
  for (const double gain : {1.0, 0.0}) {
    Holding h;
    h.gain = gain;
    h.wanted.budget.refill_W = 0;
    h.velocity = {0, -0.2, 0};
    for (int ms = 0; ms < 200; ++ms) {
      if (ms % 20 == 0) h.hold({0, 2, 0});
      h.step();
    }
    EXPECT_NEAR(h.out.energy_J, gain > 0 ? 0.050 : 0.020, 1e-9) << "gain " << gain;
  }
}

}  // namespace
}  // namespace hapticd::realtime

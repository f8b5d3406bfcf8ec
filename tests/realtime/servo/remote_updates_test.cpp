// What a client states, repeats and leaves out changes the force of remote contacts gradually.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "base/time.h"
#include "realtime/remote/remote_contacts.h"
#include "realtime/remote/remote_input.h"
#include "realtime/servo/remote_rig.h"
#include "reduced.h"

namespace hapticd::realtime {
namespace {

RemoteContact movingFloor(Draw& draw) {
  const double height_m = 0.002 * draw();
  RemoteContact c = floorAt(height_m, 300 + 250 * draw());
  c.normal = draw.nearlyUp(0.3);
  c.velocity_m_per_s = 0.02 * draw.vector();  // 0.01 N/ms, which is no step of an update
  c.damping_Ns_per_m = 1 + draw();
  c.yields = true;
  return c;
}

// The largest change of the force in a tick, with an update every 17 ms and the hand at rest or along x.
double largestStep(int ticks, const std::function<std::vector<RemoteContact>()>& contacts,
                   double speed_m_per_s = 0) {
  RemoteRig rig;
  Vec3 last = Vec3::Zero();
  double largest = 0;
  for (int ms = 0; ms < ticks; ++ms) {
    if (ms % 17 == 0) rig.state(contacts());
    rig.hand.velocity_m_per_s.x() = speed_m_per_s;
    rig.hand.position_m.x() += 1e-3 * speed_m_per_s;
    const Vec3 force = rig.step();
    largest = std::max(largest, (force - last).norm());
    last = force;
  }
  EXPECT_GT(largest, 0.01) << "nothing is felt";
  return largest;
}

// Whatever a client states, many contacts too. One has friction, with equal coefficients: a slip from one to
// the other is no update.
TEST(RemoteContacts, NoUpdateMakesAStep) {
  for (const int most : {1, 3, 16}) {
    for (int seed = 0; seed < (most == 1 ? 200 : 20); ++seed) {
      Draw draw(seed);
      const double largest = largestStep(3000, [&] {
        std::vector<RemoteContact> contacts;
        for (int id = 0; id < most; ++id) {
          if (draw() > 0.5) continue;
          RemoteContact c = movingFloor(draw);
          c.id = id;
          if (most == 1) c.staticFriction = c.dynamicFriction = 0.3 + 0.3 * draw();
          c.lifetime = 40 * kMs;
          contacts.push_back(c);
        }
        return contacts;
      });
      EXPECT_LT(largest, kRate_N_per_ms) << most << " contacts, seed " << seed;
    }
  }
}

// The static coefficient falls below the one with which the tool still slides, which must follow it down.
TEST(RemoteContacts, FallingFrictionLetsTheToolSlipSlowly) {
  RemoteRig rig;
  RemoteContact c = floorAt(0);
  c.staticFriction = c.dynamicFriction = 0.8;
  rig.approach({c}, {0, 0.001, 0}, {0, -0.004, 0});
  for (int i = 0; i < 30; ++i) {
    rig.hand.position_m.x() += 5e-5;
    if (i % 16 == 0) rig.state({c});
    rig.step();
  }
  c.staticFriction = c.dynamicFriction = 0.05;
  rig.state({c});
  double last_N = -rig.force.x();
  ASSERT_GT(last_N, 0.3);
  for (int ms = 0; ms < 40; ++ms) {
    const double friction_N = -rig.step().x();
    EXPECT_LE(friction_N, last_N + kExact_N) << ms << " ms after the update";
    EXPECT_GT(friction_N, last_N - kRate_N_per_ms) << ms << " ms after the update";
    last_N = friction_N;
  }
  EXPECT_NEAR(last_N, 0.05 * 3.2, 1e-6);
}

// A face that comes to bear goes on with the friction of the one that bore before; a softer one with what
// holds the same energy.
TEST(RemoteContacts, AnotherBearerTakesTheFrictionOver) {
  for (const double stiffness : {800.0, 1600.0, 200.0}) {
    RemoteRig rig;
    RemoteContact lower = floorAt(0);
    lower.staticFriction = lower.dynamicFriction = 0.5;
    RemoteContact rising = lower;
    rising.id = 1;
    rising.stiffness_N_per_m = stiffness;
    rising.point_m.y() = -0.001;
    rising.velocity_m_per_s.y() = 0.5;
    rising.yields = true;
    rig.approach({lower}, {0, 0.001, 0}, {0, -0.003, 0});
    for (int i = 0; i < 8; ++i) {
      rig.hand.position_m.x() += 5e-5;
      rig.step();
    }
    const double friction_N = -0.5 * 800 * 4e-4;
    rig.state({lower, rising});
    const double kept_N = std::min(1.0, std::sqrt(stiffness / 800)) * friction_N;
    double last_N = friction_N;
    for (int ms = 0; ms < 40; ++ms) {
      const double now_N = rig.step().x();
      EXPECT_GE(now_N, last_N - kExact_N) << ms;
      EXPECT_LE(now_N, std::min(kept_N, last_N + 0.01) + kExact_N) << ms;
      last_N = now_N;
    }
    EXPECT_NEAR(last_N, kept_N, kExact_N);
    ASSERT_EQ(rig.out.count, 1U);
    EXPECT_EQ(rig.out.contacts[0].id, 1) << "it has risen past the other";
  }
}

// Where the client states equal coefficients, no slip finds them apart while they follow an update.
TEST(RemoteContacts, EqualCoefficientsStayEqual) {
  for (const int seed : {1, 4, 345}) {
    Draw draw(seed);
    const double largest = largestStep(
        3000,
        [&] {
          std::vector<RemoteContact> contacts;
          const double friction = 0.3 + 0.3 * draw();
          if (draw() > 0.6) return contacts;
          RemoteContact c = movingFloor(draw);
          c.staticFriction = c.dynamicFriction = friction;
          contacts.push_back(c);
          return contacts;
        },
        0.05);
    EXPECT_LT(largest, kRate_N_per_ms) << "seed " << seed;
  }
}

// Faces with friction that nearly coincide. Seeds in which the friction of one that no longer bore was lost.
TEST(RemoteContacts, OtherBearersWithFrictionMakeNoStep) {
  for (const int seed : {51, 67, 82}) {
    Draw draw(seed);
    const double largest = largestStep(3000, [&] {
      std::vector<RemoteContact> contacts;
      for (int id = 0; id < 5; ++id) {
        if (draw() > 0.6) continue;
        RemoteContact c = movingFloor(draw);
        c.id = id;
        c.staticFriction = c.dynamicFriction = 0.3 + 0.3 * draw();
        contacts.push_back(c);
      }
      return contacts;
    });
    EXPECT_LT(largest, kRate_N_per_ms) << "seed " << seed;
  }
}

std::vector<RemoteContact> facesAnywhere(Draw& draw) {
  std::vector<RemoteContact> contacts;
  for (int id = 0; id < 5; ++id) {
    if (draw() > 0.6) continue;
    const double height_m = 0.002 * draw();
    RemoteContact c = floorAt(height_m, 300 + 250 * draw());
    c.id = id;
    do c.normal = draw.vector();
    while (c.normal.norm() > 1 || c.normal.norm() < 0.1);
    c.normal.normalize();
    c.damping_Ns_per_m = 1 + draw();
    c.yields = true;
    contacts.push_back(c);
  }
  return contacts;
}

// Four faces of which three touch in a row make the demands' system indefinite: from one tick to the next
// others bear. Seeds of arbitrary normals in which the sum jumped by up to 0.8 N.
TEST(RemoteContacts, OtherBearersMakeNoStep) {
  for (const int seed : {197, 471, 647, 1173, 1427, 1949}) {
    Draw draw(seed);
    EXPECT_LT(largestStep(3000, [&] { return facesAnywhere(draw); }), kRate_N_per_ms) << "seed " << seed;
  }
}

// In a corner the sum changes faster than what each face demands. Without friction, whose slip is no update.
TEST(RemoteContacts, NoUpdateOfACornerMakesAStep) {
  for (const bool comeAndGo : {false, true}) {
    for (const int faces : {2, 3, 5}) {
      for (int seed = 0; seed < reduced(60); ++seed) {
        Draw draw(seed);
        const double largest = largestStep(3000, [&] {
          std::vector<RemoteContact> contacts;
          for (int id = 0; id < faces; ++id) {
            if (comeAndGo && draw() > 0.6) continue;  // it fades
            const double stiffness = 300 + 250 * draw();
            RemoteContact c = floorAt(0.002 * draw(), stiffness);
            c.id = id;
            c.normal = draw.nearlyUp(0.3);
            c.damping_Ns_per_m = 1 + draw();
            c.yields = true;
            contacts.push_back(c);
          }
          return contacts;
        });
        EXPECT_LT(largest, kRate_N_per_ms)
            << faces << " faces, seed " << seed << (comeAndGo ? ", some absent" : "");
      }
    }
  }
}

// The surface stays where it is stated: a hand that leaves it feels nothing outside, and gets no more than
// the spring held.
TEST(RemoteContacts, ASurfaceThatSoftensIsNotFeltOutside) {
  for (const double softer : {300.0, 100.0, 20.0, 1.0}) {
    RemoteRig rig;
    rig.approach({floorAt(0, 1000)}, {0, 0.001, 0}, {0, -0.003, 0});
    rig.settle({floorAt(0, 1000)}, 16);
    double work_J = 0;
    for (int ms = 0; ms < 400; ++ms) {
      if (ms % 16 == 0) rig.state({floorAt(0, softer)});
      const Vec3 before_N = rig.force;
      rig.hand.position_m.y() += 0.0002;
      rig.step();
      work_J += 0.5 * 0.0002 * (before_N + rig.force).y();
      if (rig.hand.position_m.y() > 0) {
        ASSERT_EQ(rig.force.norm(), 0) << softer << " N/m, " << ms << " ms";
      }
    }
    EXPECT_LE(work_J, 0.5 * 3 * 0.003 + 1e-9) << softer << " N/m";
  }
}

// Surfaces on top of each other take one spring from the hand, and give back no more when they fade or
// soften: else the one that stays would push it out with what was never taken.
TEST(RemoteContacts, CoincidentSurfacesGiveBackOneSpring) {
  for (const bool soften : {false, true}) {
    double worked_J[2] = {};
    for (const int floors : {1, 16}) {
      RemoteRig rig;
      const auto all = [&](double stiffness) {
        std::vector<RemoteContact> set(static_cast<std::size_t>(floors), floorAt(0, stiffness));
        for (int i = 0; i < floors; ++i) set[static_cast<std::size_t>(i)].id = i;
        return set;
      };
      double& work_J = worked_J[floors > 1];
      const auto follow = [&](const std::vector<RemoteContact>& set, double to_m, int ticks) {
        const double from_m = rig.hand.position_m.y();
        for (int i = 1; i <= ticks; ++i) {
          if (i % 8 == 1) rig.state(set);
          const double before_N = rig.force.y();
          const double before_m = rig.hand.position_m.y();
          rig.hand.position_m.y() = from_m + (to_m - from_m) * i / ticks;
          rig.step();
          work_J += 0.5 * (before_N + rig.force.y()) * (rig.hand.position_m.y() - before_m);
        }
      };
      rig.hand.position_m = {0, 0.001, 0};
      for (int round = 0; round < 10; ++round) {
        follow(all(1000), 0.001, 20);
        follow(all(1000), -0.0025, 20);
        follow(soften ? all(1) : std::vector<RemoteContact>{floorAt(0, 1000)}, -0.0025, 460);
        follow({floorAt(0.006, 1000)}, -0.0025, 60);  // rises, and does not say so
        follow({floorAt(0.006, 1000)}, 0.0075, 60);
        follow({}, 0.0075, 20);
        follow({}, 0.001, 20);
      }
    }
    EXPECT_NEAR(worked_J[1], worked_J[0], 0.005) << (soften ? "softened" : "faded");
  }
}

TEST(RemoteContacts, LifeIncludesTheFade) {
  RemoteRig rig;
  RemoteContact c = floorAt(0);
  c.lifetime = 60 * kMs;
  rig.approach({c}, {0, 0.001, 0}, {0, -0.004, 0});
  ASSERT_NEAR(rig.force.y(), 3.2, 1e-6);
  rig.state({c});
  const Nanos received = rig.now;
  double last = rig.force.y();
  while (rig.now < received + 60 * kMs) {
    const double force = rig.step().y();
    EXPECT_LE(force, last + kExact_N);
    EXPECT_GE(force, last - kRate_N_per_ms);
    if (rig.now <= received + 30 * kMs) {
      EXPECT_NEAR(force, 3.2, 1e-6);
    }
    last = force;
  }
  EXPECT_EQ(last, 0);
  EXPECT_EQ(rig.out.count, 0U);
}

// Two walls of a groove, or a floor, pressed with a force that the client's updates find at rest.
std::vector<RemoteContact> floorOrGroove(int walls, double stiffness, Nanos lifetime) {
  RemoteContact c = floorAt(0, stiffness);
  c.point_m.setZero();
  c.lifetime = lifetime;
  if (walls == 1) return {c};
  c.normal = Vec3(1, 1, 0).normalized();
  RemoteContact other = c;
  other.id = 1;
  other.normal.x() = -other.normal.x();
  return {c, other};
}

// Within two thirds of their life.
TEST(RemoteContacts, ThoseRepeatedInTimeDoNotFade) {
  struct Client {
    int every_ms;
    int life_ms;
  };
  for (const Client client : {Client{33, 100}, {10, 40}, {33, 50}, {1, 10}, {4, 10}, {10, 30}}) {
    for (const int walls : {1, 2}) {
      for (const double force_N : {2.0, 5.0, 11.0}) {
        if (force_N > client.life_ms - client.every_ms - 2) continue;  // it may fall by 1 N/ms
        const auto contacts = floorOrGroove(walls, 1000, client.life_ms * kMs);
        RemoteRig rig;
        for (int ms = 0; ms < 4000; ++ms) {
          rig.hand.position_m.y() = std::max(-1e-3 * force_N, 0.002 - 2e-5 * ms);
          if (ms % client.every_ms == 0) rig.state(contacts);
          rig.step();
          ASSERT_NEAR(rig.force.y(), 1e3 * std::max(0.0, -rig.hand.position_m.y()), 1e-6)
              << force_N << " N, every " << client.every_ms << " ms for " << client.life_ms << " ms, "
              << walls;
        }
      }
    }
  }
}

// The hand gave what a fade took: it does not empty the tank of corrections.
TEST(RemoteContacts, WhatAFadeTookComesBack) {
  for (const int walls : {1, 2}) {
    for (const double stiffness : {200.0, 1000.0}) {
      const auto contacts = floorOrGroove(walls, stiffness, 100 * kMs);
      RemoteRig rig;
      constexpr double kForce_N = 3;
      int next_ms = 0;
      for (int ms = 0; ms < 8000; ++ms) {
        rig.hand.position_m.y() = std::max(-kForce_N / stiffness, 0.002 - 2e-5 * ms);
        if (ms >= next_ms) {
          const bool stall = ms > 2000 && ms % 300 < 10;
          if (stall) {
            ASSERT_NEAR(rig.force.y(), kForce_N, 1e-6) << "before the stall at " << ms;
          }
          rig.state(contacts);
          next_ms = ms + (stall ? 90 : 10);
        }
        rig.step();
        ASSERT_EQ(rig.out.status & kRemoteCorrectionsHeld, 0U) << ms;
      }
    }
  }
}

TEST(RemoteContacts, AStrongForceOfALostClientEndsInTimeWithoutAStep) {
  for (const int life_ms : {30, 50, 100}) {
    for (const int walls : {1, 2}) {
      const auto contacts = floorOrGroove(walls, 1500, life_ms * kMs);
      RemoteRig rig;
      for (int ms = 0; ms < 500; ++ms) {
        rig.hand.position_m.y() = std::max(-0.010, 0.002 - 4e-5 * ms);
        if (ms % 4 == 0) rig.state(contacts);
        rig.step();
      }
      ASSERT_NEAR(rig.force.y(), 15, 1e-6);
      rig.state(contacts);
      const Nanos received = rig.now;
      while (rig.now < received + life_ms * kMs) {
        const Vec3 last_N = rig.force;
        EXPECT_LE((rig.step() - last_N).norm(), 1) << life_ms << " ms, " << walls << " walls";
      }
      EXPECT_EQ(rig.force, Vec3::Zero());
    }
  }
}

TEST(RemoteContacts, AbsentOnesFadeAtOnce) {
  RemoteRig rig;
  RemoteContact side = floorAt(0);
  side.id = 1;
  side.point_m.setZero();
  side.normal = Vec3::UnitX();
  rig.approach({floorAt(0), side}, {0.001, 0.001, 0}, {-0.002, -0.002, 0});
  ASSERT_NEAR(rig.force.x(), 1.6, 1e-6);
  rig.state({floorAt(0)});
  double last = rig.force.x();
  int ms = 0;
  for (; last > 0 && ms < 100; ++ms) {
    rig.step();
    EXPECT_GE(rig.force.x(), last - kRate_N_per_ms);
    EXPECT_NEAR(rig.force.y(), 1.6, 1e-6);
    last = rig.force.x();
  }
  EXPECT_LT(ms, 20);
}

}  // namespace
}  // namespace hapticd::realtime

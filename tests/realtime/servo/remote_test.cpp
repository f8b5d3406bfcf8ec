// The laws of remote contacts and held forces against closed forms.
#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <vector>

#include "base/time.h"
#include "realtime/remote/held_force.h"
#include "realtime/remote/normal_shares.h"
#include "realtime/remote/remote_contacts.h"
#include "reduced.h"

namespace hapticd::realtime {
namespace {

constexpr Nanos kMs = 1'000'000;
constexpr double kRate_N_per_ms = 0.3;
constexpr double kExact_N = 1e-9;

RemoteContact floorAt(double height_m, double stiffness = 800) {
  RemoteContact c;
  c.point_m = {0.02, height_m, -0.01};
  c.normal = Vec3::UnitY();
  c.stiffness_N_per_m = stiffness;
  return c;
}

// A servo of 1 kHz and a client that states whatever the test sets.
struct Rig {
  RemoteContacts law;
  RemoteContactSet set;
  RemoteHand hand;
  RemoteRendering out;
  Vec3 force = Vec3::Zero();
  Nanos now = 1000 * kMs;

  void state(std::vector<RemoteContact> contacts) {
    ++set.number;
    set.received = set.stated = now;
    set.count = static_cast<std::uint32_t>(contacts.size());
    std::copy(contacts.begin(), contacts.end(), set.contacts.begin());
  }
  // The servo counts a late tick for no more than two.
  const Vec3& step(Nanos late = 0) {
    now += kMs + late;
    out = {};
    force = law.step(set, hand, now, base::toSeconds(kMs + std::min(late, kMs)), out);
    return force;
  }
  // States the same every 16 ms.
  void settle(const std::vector<RemoteContact>& contacts, int ticks) {
    for (int i = 0; i < ticks; ++i) {
      if (i % 16 == 0) state(contacts);
      step();
    }
  }
  // From outside to the place, so that nothing appears around the hand.
  void approach(const std::vector<RemoteContact>& contacts, const Vec3& from, const Vec3& to) {
    for (int i = 0; i <= 100; ++i) {
      hand.position_m = from + i / 100.0 * (to - from);
      if (i % 16 == 0) state(contacts);
      step();
    }
  }
};

void expectNear(const Vec3& a, const Vec3& b, double tolerance) {
  EXPECT_LE((a - b).norm(), tolerance) << a.transpose() << " instead of " << b.transpose();
}

TEST(RemoteContacts, HalfSpaceIsASpringFromTheFirstTouch) {
  Rig rig;
  rig.state({floorAt(0)});
  for (double y = 0.001; y > -0.003; y -= 0.0001) {
    rig.hand.position_m = {0, y, 0};
    if (rig.now % (10 * kMs) == 0) rig.state({floorAt(0)});
    expectNear(rig.step(), {0, 800 * std::max(0.0, -y), 0}, kExact_N);
  }
  ASSERT_EQ(rig.out.count, 1U);
  EXPECT_NEAR(rig.out.contacts[0].depth_m, -rig.hand.position_m.y(), 1e-9);
  EXPECT_NEAR(rig.out.contacts[0].proxy_m.y(), 0, 1e-9);
  EXPECT_NEAR(rig.out.contacts[0].force_N.y(), rig.force.y(), 1e-6);
}

TEST(RemoteContacts, SphereStaysRoundBetweenUpdates) {
  Rig rig;
  RemoteContact ball = floorAt(0);
  ball.shape = RemoteShape::sphere;
  ball.radius_m = 0.030;
  ball.point_m = {0, 0.030, 0};  // its centre is the origin
  for (const double angle : {0.0, 0.3, -0.8, 1.2}) {
    const Vec3 out(std::sin(angle), std::cos(angle), 0);
    rig.approach({ball}, 0.031 * out, 0.0285 * out);
    expectNear(rig.force, 800 * 0.0015 * out, 1e-6);
  }
  // The same from inside a hollow sphere: it pushes to the centre.
  Rig hollow;
  ball.radius_m = -0.030;
  ball.normal = -Vec3::UnitY();
  hollow.approach({ball}, {0.028, 0, 0}, {0.0315, 0, 0});
  expectNear(hollow.force, {-800 * 0.0015, 0, 0}, 1e-6);
}

TEST(RemoteContacts, CylinderIsFlatAlongItsAxis) {
  Rig rig;
  RemoteContact rod = floorAt(0);
  rod.shape = RemoteShape::cylinder;
  rod.radius_m = 0.010;
  rod.point_m = {0, 0.010, 0};
  rod.axis = Vec3::UnitZ();
  const Vec3 out(0.6, 0.8, 0);
  rig.approach({rod}, 0.011 * out, 0.009 * out + Vec3(0, 0, 0.05));
  expectNear(rig.force, 800 * 0.001 * out, 1e-6);
}

TEST(RemoteContacts, SurfacesMoveByTheirVelocities) {
  Rig rig;
  rig.hand.position_m = {0, -0.001, 0};
  RemoteContact rising = floorAt(-0.002);
  rising.point_m.setZero();
  rising.point_m.y() = -0.002;
  rising.velocity_m_per_s = {0, 0.1, 0};
  rig.state({rising});
  for (int ms = 1; ms <= 30; ++ms)
    expectNear(rig.step(), {0, 800 * std::max(0.0, 1e-4 * ms - 0.001), 0}, 1e-9);

  Rig turning;
  RemoteContact wheel = floorAt(0);
  wheel.point_m.setZero();
  wheel.angularVelocity_rad_per_s = {0, 0, 2};
  turning.hand.position_m = {-0.02, 0.0001, 0};
  turning.state({wheel});
  for (int ms = 1; ms <= 40; ++ms) turning.step();
  const double angle = 2 * 0.040;
  const Vec3 normal(-std::sin(angle), std::cos(angle), 0);
  const double depth = -normal.dot(turning.hand.position_m);
  EXPECT_LT(depth, 0) << "the surface turns away on this side";
  turning.hand.position_m = {0.02, 0.0001, 0};
  Rig other;
  other.hand.position_m = {0.02, 0.0001, 0};
  other.state({wheel});
  for (int ms = 1; ms <= 40; ++ms) other.step();
  expectNear(other.force, 800 * -normal.dot(other.hand.position_m) * normal, 1e-6);
}

// A wheel, or a ball, that turns about its own axis is the same surface at all times.
TEST(RemoteContacts, RoundSurfacesTurnAboutTheirCentre) {
  for (const RemoteShape shape : {RemoteShape::cylinder, RemoteShape::sphere}) {
    for (const double radius_m : {0.02, 0.05, -0.02}) {
      const Vec3 centre_m(0, -radius_m, 0);
      const Vec3 spin_rad_per_s(0, 0, -19);
      Rig rig;
      for (int ms = 0; ms < 2000; ++ms) {
        rig.hand.position_m.y() = std::max(-0.001, 0.002 - 2e-5 * ms);
        if (ms % 33 == 0) {
          RemoteContact c = floorAt(0, 1000);
          c.shape = shape;
          c.radius_m = radius_m;
          c.point_m = centre_m + radius_m * c.normal;
          c.angularVelocity_rad_per_s = spin_rad_per_s;
          c.velocity_m_per_s = spin_rad_per_s.cross(radius_m * c.normal);
          rig.state({c});
        }
        rig.step();
        const double depth_m = std::max(0.0, -rig.hand.position_m.y());
        ASSERT_NEAR(rig.force.y(), 1000 * depth_m, 1e-6) << radius_m << " m, " << ms << " ms";
        ASSERT_NEAR(rig.force.x(), 0, 1e-6);
        ASSERT_EQ(rig.out.status & kRemoteCorrectionsHeld, 0U);
      }
    }
  }
}

// A door that swings about a hinge, with the hand at one place of it: it does not matter which point the
// client states.
TEST(RemoteContacts, FlatSurfacesTurnAboutTheirHinge) {
  constexpr double kHand_m = 0.1;  // from the hinge
  constexpr double kSpeed_rad_per_s = 5;
  for (const double stated_m : {0.1, 0.07, 0.13}) {
    Rig rig;
    const auto along = [](double angle) { return Vec3(std::cos(angle), std::sin(angle), 0); };
    const auto normal = [](double angle) { return Vec3(-std::sin(angle), std::cos(angle), 0); };
    for (int ms = 0; ms < 400; ++ms) {
      const double angle = 1e-3 * kSpeed_rad_per_s * ms;
      if (ms % 33 == 0) {
        RemoteContact c = floorAt(0, 1000);
        c.point_m = stated_m * along(angle);
        c.normal = normal(angle);
        c.angularVelocity_rad_per_s = {0, 0, kSpeed_rad_per_s};
        c.velocity_m_per_s = c.angularVelocity_rad_per_s.cross(c.point_m);
        rig.state({c});
      }
      const double next = angle + 1e-3 * kSpeed_rad_per_s;
      const double depth_m = std::min(0.0015, 3e-5 * ms - 0.001);
      rig.hand.position_m = kHand_m * along(next) - depth_m * normal(next);
      rig.step();
      ASSERT_LE((rig.force - 1000 * std::max(0.0, depth_m) * normal(next)).norm(), 1e-6)
          << stated_m << " m, " << ms << " ms";
    }
  }
}

// Draws in the order of the calls, whatever the compiler.
class Draw {
 public:
  explicit Draw(int seed) : random_(static_cast<unsigned>(seed)) {}
  double operator()() { return unit_(random_); }
  Vec3 vector() {
    const double x = unit_(random_);
    const double y = unit_(random_);
    return {x, y, unit_(random_)};
  }
  Vec3 nearlyUp(double spread) {
    const double x = spread * unit_(random_);
    return Vec3(x, 1, spread * unit_(random_)).normalized();
  }

 private:
  std::mt19937 random_;
  std::uniform_real_distribution<double> unit_{-1, 1};
};

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
  Rig rig;
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
  Rig rig;
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
    Rig rig;
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
    Rig rig;
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
      Rig rig;
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
  Rig rig;
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
        Rig rig;
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
      Rig rig;
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
      Rig rig;
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
  Rig rig;
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

TEST(RemoteContacts, SurfacesOnTopOfEachOtherAreAsStiffAsOne) {
  Rig rig;
  std::vector<RemoteContact> contacts;
  for (int id = 0; id < 16; ++id) {
    contacts.push_back(floorAt(0));
    contacts.back().id = id;
    contacts.back().point_m.x() = 0.001 * id;
  }
  rig.approach(contacts, {0, 0.001, 0}, {0, -0.002, 0});
  expectNear(rig.force, {0, 1.6, 0}, 1e-6);

  // Of surfaces on top of each other, those of the scene included, the larger force is felt; across each
  // other they add up. The remote force is what is added to that of the scene.
  const auto besideScene = [&](const Vec3& normal, double depth_m, double stiffness_N_per_m) {
    rig.hand.scene = {};
    rig.hand.scene.add(normal, depth_m);
    rig.hand.scene.stiffness_N_per_m = stiffness_N_per_m;
    rig.settle(contacts, 1);
    return rig.force;
  };
  expectNear(besideScene(Vec3::UnitY(), 0.002, 500), {0, 0.6, 0}, 1e-6);
  expectNear(besideScene(Vec3::UnitY(), 0.002, 800), {0, 0, 0}, 1e-6);
  expectNear(besideScene(Vec3::UnitY(), 0.001, 1200), {0, 0.4, 0}, 1e-6);
  expectNear(besideScene(Vec3::UnitX(), 0.001, 1200), {0, 1.6, 0}, 1e-6);
}

// Whatever the contacts, each adds what the others do not exert, to the solver's last digits; a softer one is
// relieved as if it were the stiffer. The shares of the last tick are those of other contacts here.
TEST(RemoteContacts, SharesMeetEveryDemandOnce) {
  Draw draw(3);
  int inexact = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    PressingContacts contacts;
    std::vector<double> demands_N;
    std::vector<double> stiffness;
    const int count = 1 + static_cast<int>(7.999 * (draw() + 1));
    const double spread = trial % 2 == 0 ? 0.3 : 3;
    const double decades = trial % 4 < 2 ? 0 : 0.5;
    for (int i = 0; i < count; ++i) {
      const bool same = i > 0 && draw() > 0.7;  // two points of one plane
      const Vec3 normal = draw.nearlyUp(spread);
      demands_N.push_back(1.5 + 2.5 * draw());
      stiffness.push_back(1000 * std::pow(10, decades * draw()));
      contacts.add(same ? Vec3(contacts.x[0], contacts.y[0], contacts.z[0]) : normal, stiffness.back(),
                   demands_N.back(), std::max(0.0, draw()));
    }
    shareNormalForce(contacts);
    double worst_N = 0;
    for (std::size_t i = 0; i < contacts.count; ++i) {
      double others_N = 0;
      for (std::size_t j = 0; j < contacts.count; ++j) {
        const double cosine =
            contacts.x[i] * contacts.x[j] + contacts.y[i] * contacts.y[j] + contacts.z[i] * contacts.z[j];
        const double weight = std::min(1.0, stiffness[i] / stiffness[j]);
        if (j != i) others_N += weight * std::max(0.0, cosine) * contacts.share_N[j];
      }
      worst_N = std::max(worst_N, std::abs(contacts.share_N[i] - std::max(0.0, demands_N[i] - others_N)));
    }
    ASSERT_LT(worst_N, 0.1) << count << " contacts, trial " << trial;
    inexact += worst_N > 1e-6;
  }
  EXPECT_LT(inexact, 200) << "the sweeps that replace the solver end early";
}

// A contact that the hand leaves fast demands a pull, which is no force.
TEST(RemoteContacts, ContactsThatBoreForceAndNowDemandAPullHaveNoShare) {
  for (const int count : {1, 2, 9}) {
    for (const double share_N : {0.0, 1.0}) {
      PressingContacts contacts;
      for (int i = 0; i < count; ++i)
        contacts.add(Vec3(0.1 * i, 1, 0).normalized(), 800, -0.5 - 0.1 * i, share_N);
      shareNormalForce(contacts);
      for (std::size_t i = 0; i < contacts.count; ++i)
        EXPECT_EQ(contacts.share_N[i], 0) << i << " of " << count;
    }
  }
}

TEST(RemoteContacts, UnequalSurfacesOnTopOfEachOtherExertTheLargerForce) {
  for (const double height_m : {-0.001, 0.0, 0.0005, 0.001, 0.004}) {
    Rig rig;
    const RemoteContact hard = floorAt(0, 1000);
    RemoteContact soft = floorAt(height_m, 300);
    soft.id = 1;
    rig.approach({hard, soft}, {0, 0.005, 0}, {0, -0.002, 0});
    expectNear(rig.force, {0, std::max(1000 * 0.002, 300 * (0.002 + height_m)), 0}, 1e-6);
  }
}

// Faces around the bottom of a hollow, and a hand that comes from outside, goes round in circles of 1 mm
// inside the faces, and leaves. The work is that of the hand on them, by the trapezoidal rule.
struct Hollow {
  Rig rig;
  std::vector<RemoteContact> faces;
  double work_J = 0;
  int ticks = 0;

  Hollow(int count, double decades, double friction, Draw& draw) {
    for (int id = 0; id < count; ++id) {
      RemoteContact c = floorAt(0, 1000 * std::pow(10, 0.5 * decades * (draw() - 1)));
      c.id = id;
      c.point_m.setZero();
      c.normal = draw.nearlyUp(0.7);
      c.staticFriction = c.dynamicFriction = friction;
      c.lifetime = 100 * kMs;
      faces.push_back(c);
    }
    rig.hand.position_m = kOutside;
  }
  void goTo(const Vec3& to_m) {
    if (ticks++ % 16 == 0) rig.state(faces);
    const Vec3 before_N = rig.force;
    const Vec3 step_m = to_m - rig.hand.position_m;
    rig.hand.position_m = to_m;
    work_J -= 0.5 * (before_N + rig.step()).dot(step_m);
  }
  void line(const Vec3& to_m, int steps) {
    const Vec3 from_m = rig.hand.position_m;
    for (int i = 1; i <= steps; ++i) goTo(from_m + i * (to_m - from_m) / steps);
  }
  void circle(const Vec3& centre_m, const Vec3& across, double direction, int steps) {
    for (int i = 1; i <= steps; ++i) {
      const double angle = direction * 2 * M_PI * i / steps;
      goTo(centre_m + 0.001 * (std::cos(angle) * Vec3::UnitX() + std::sin(angle) * across));
    }
  }
  // What the hand gave in each of three circles, and on the whole way.
  double roundTrip_J(double direction, const Vec3& centre_m, const Vec3& across) {
    line(centre_m + 0.001 * Vec3::UnitX(), 300);
    const double before_J = work_J;
    for (int i = 0; i < 3; ++i) circle(centre_m, across, direction, 2000);
    circles_J = (work_J - before_J) / 3;
    line(kOutside, 300);
    return work_J;
  }
  double circles_J = 0;
  const Vec3 kOutside{0, 0.01, 0};
};

TEST(RemoteContacts, UnequalStiffnessMakesNoEnergy) {
  for (const int faces : {2, 3, 5}) {
    for (int seed = 0; seed < reduced(10); ++seed) {
      for (const double direction : {1.0, -1.0}) {
        Draw draw(seed);
        Hollow hollow(faces, 2, 0, draw);
        const Vec3 centre_m(0.001 * draw(), -0.003, 0.001 * draw());
        hollow.roundTrip_J(direction, centre_m, Vec3(0, 1, 0.5 * draw()).normalized());
        EXPECT_NEAR(hollow.circles_J, 0, 1e-9) << faces << " faces, seed " << seed;
        EXPECT_EQ(hollow.rig.force, Vec3::Zero());
      }
    }
  }
}

// The springs of friction change with the shares of the normal force. What they are lent at the first touch
// is all that they may ever give.
TEST(RemoteContacts, FrictionOfSeveralFacesGivesNoEnergy) {
  constexpr double kLent_J = 2e-4;
  for (const int faces : {2, 3, 5, 8}) {
    for (int seed = 0; seed < reduced(10); ++seed) {
      for (const double friction : {0.2, 0.5, 1.0}) {
        for (const double direction : {1.0, -1.0}) {
          Draw draw(seed);
          Hollow hollow(faces, seed % 2 == 0 ? 0 : 1, friction, draw);
          const Vec3 centre_m(0.001 * draw(), -0.003, 0.001 * draw());
          const Vec3 across = Vec3(0, 1, 0.5 * draw()).normalized();
          EXPECT_GT(hollow.roundTrip_J(direction, centre_m, across), -kLent_J - 1e-9)
              << faces << " faces, seed " << seed << ", coefficient " << friction;
        }
      }
    }
  }
}

TEST(RemoteContacts, TremorInACornerDoesNotWearFrictionOut) {
  for (int seed = 0; seed < 4; ++seed) {
    Draw draw(seed);
    Hollow hollow(3, 0, 0.5, draw);
    hollow.line({0, -0.003, 0}, 300);
    const Vec3 place_m(0.0005, -0.003, 0.0003);
    hollow.line(place_m, 100);
    const Vec3 before_N = hollow.rig.force;
    for (int ms = 0; ms <= 20'000; ++ms) {
      const double t = 2 * M_PI * 1e-3 * ms;
      hollow.goTo(place_m + 1e-4 * Vec3(std::sin(8 * t), std::sin(9 * t), std::sin(11 * t)));
    }
    hollow.goTo(place_m);
    EXPECT_LT((hollow.rig.force - before_N).norm(), 0.01) << "seed " << seed;
  }
}

// Each demands its spring force along its normal: the forces of a corner of 60 degrees are solved, not
// summed.
TEST(RemoteContacts, CornersExertWhatEachFaceDemands) {
  Rig rig;
  RemoteContact a = floorAt(0);
  a.point_m.setZero();
  a.normal = Vec3(std::sin(0.5), std::cos(0.5), 0);
  RemoteContact b = a;
  b.id = 1;
  b.normal.x() = -b.normal.x();
  rig.approach({a, b}, {0, 0.001, 0}, {0.0003, -0.002, 0});
  EXPECT_NEAR(rig.force.dot(a.normal), -800 * a.normal.dot(rig.hand.position_m), 1e-5);
  EXPECT_NEAR(rig.force.dot(b.normal), -800 * b.normal.dot(rig.hand.position_m), 1e-5);
}

TEST(RemoteContacts, FrictionSticksAndSlides) {
  Rig rig;
  RemoteContact c = floorAt(0);
  c.staticFriction = 0.5;
  c.dynamicFriction = 0.3;
  rig.approach({c}, {0, 0.001, 0}, {0, -0.002, 0});
  const double normal = 1.6;
  double largest = 0;
  for (int i = 0; i < 200; ++i) {
    rig.hand.position_m.x() += 5e-5;
    if (i % 16 == 0) rig.state({c});
    rig.step();
    largest = std::max(largest, -rig.force.x());
  }
  EXPECT_NEAR(largest, 0.5 * normal, 0.03);
  EXPECT_NEAR(rig.force.x(), -0.3 * normal, 1e-6);
  EXPECT_NEAR(rig.force.y(), normal, 1e-6);
}

// The hand goes along with a belt, so that nothing strains the friction; some ticks are late.
TEST(RemoteContacts, FrictionOfAMovingSurfaceKeepsUpWithLateTicks) {
  constexpr double kSpeed_m_per_s = 0.1;
  for (const Nanos late : {2 * kMs, 5 * kMs, 14 * kMs}) {
    Rig rig;
    const Nanos began = rig.now;
    const auto travelled = [&](Nanos at) { return kSpeed_m_per_s * base::toSeconds(at - began); };
    for (int i = 0; i < 1500; ++i) {
      if (i % 10 == 0) {
        RemoteContact belt = floorAt(0, 1000);
        belt.staticFriction = belt.dynamicFriction = 0.8;
        belt.velocity_m_per_s.x() = kSpeed_m_per_s;
        rig.state({belt});
      }
      const Nanos lateNow = i > 600 && i % 50 == 0 ? late : 0;
      rig.hand.velocity_m_per_s.x() = kSpeed_m_per_s;
      rig.hand.position_m = {travelled(rig.now + kMs + lateNow), std::max(-0.002, 0.002 - 2e-5 * i), 0};
      rig.step(lateNow);
      ASSERT_NEAR(rig.force.x(), 0, 1e-6) << "tick " << i << ", late by " << late / kMs << " ms";
    }
    EXPECT_NEAR(rig.force.y(), 2, 1e-6);
  }
}

// A recording that begins between both does not know that the view moved: it must not matter.
TEST(RemoteContacts, AViewThatMovedBeforeThemDoesNotMoveThem) {
  Rig rig;
  rig.hand.position_m = {0, 0.001, 0};
  rig.law.moveWithView(geometry::Affine::Identity());
  rig.step();
  rig.settle({floorAt(0)}, 1);
  EXPECT_TRUE(rig.law.rest());
}

TEST(RemoteContacts, TheSlowestTurnIsNone) {
  RemoteContact floor = floorAt(0);
  floor.angularVelocity_rad_per_s = {1e-321, 0, 1e-200};  // whose norm is 0 in double precision
  Rig rig;
  rig.approach({floor}, {0, 0.01, 0}, {0, -0.001, 0});
  rig.settle({floor}, 100);
  EXPECT_NEAR(rig.force.y(), 0.8, kExact_N);
  EXPECT_TRUE(rig.force.allFinite());
}

// A body that comes to rest in a simulation: its velocity falls through the smallest numbers, whose norm is
// 0.
TEST(RemoteContacts, SurfacesThatComeToRestStayFelt) {
  Rig rig;
  RemoteContact c = floorAt(0);
  c.damping_Ns_per_m = 1;
  c.yields = true;
  rig.approach({c}, {0, 0.001, 0}, {0, -0.002, 0});
  for (double speed = 1e-3; speed > 0; speed *= 1e-30) {
    c.velocity_m_per_s = {-speed, 0, 0};
    rig.state({c});
    for (int ms = 0; ms < 4; ++ms) rig.step();
    ASSERT_NEAR(rig.force.y(), 1.6, 0.01) << "at " << speed << " m/s";
  }
}

TEST(RemoteContacts, DamperTakesEnergyAndNeverPulls) {
  Rig rig;
  RemoteContact c = floorAt(0);
  c.damping_Ns_per_m = 2;
  rig.approach({c}, {0, 0.001, 0}, {0, -0.002, 0});
  rig.hand.velocity_m_per_s = {0, -0.1, 0};
  EXPECT_NEAR(rig.step().y(), 1.6 + 0.2, 1e-6);
  rig.hand.velocity_m_per_s = {0, 0.1, 0};
  EXPECT_NEAR(rig.step().y(), 1.6 - 0.2, 1e-6);
  rig.hand.velocity_m_per_s = {0, 5, 0};
  EXPECT_EQ(rig.step().y(), 0);
}

// A surface that jumps into the hand again and again, without a velocity, pumps no more than the tank holds;
// one that yields may.
TEST(RemoteContacts, UnstatedMotionIsPaidFromTheTank) {
  double worked[2] = {};
  for (const bool yields : {false, true}) {
    Rig rig;
    RemoteContact c = floorAt(0);
    c.yields = yields;
    rig.approach({c}, {0, 0.001, 0}, {0, -0.001, 0});
    bool held = false;
    for (int ms = 0; ms < 1000; ++ms) {
      // The client lets the floor follow the hand upwards, and the hand gives way.
      if (ms % 16 == 0) {
        c.point_m.y() = rig.hand.position_m.y() + 0.002;
        rig.state({c});
      }
      rig.step();
      const double moved = 0.05e-3;
      worked[yields] += rig.force.y() * moved;
      rig.hand.position_m.y() += moved;
      held = held || (rig.out.status & kRemoteCorrectionsHeld) != 0;
    }
    EXPECT_EQ(held, !yields);
  }
  EXPECT_GT(worked[1], 0.06);
  EXPECT_LT(worked[0], 0.020 + 0.020 + 0.005) << "the start, the refill, and what the spring had stored";
}

// A client that states a surface soft while the hand presses and stiff while it leaves.
TEST(RemoteContacts, AStifferSpringIsPaidFromTheTank) {
  double worked_J[2] = {};
  for (const bool yields : {false, true}) {
    Rig rig;
    RemoteContact soft = floorAt(0, 200);
    soft.yields = yields;
    RemoteContact stiff = floorAt(0, 1000);
    stiff.yields = yields;
    rig.approach({soft}, {0, 0.001, 0}, {0, -0.002, 0});
    bool held = false;
    for (int ms = 0; ms < 2000; ++ms) {
      const bool leaves = ms % 50 >= 25;
      if (ms % 5 == 0) rig.state({leaves ? stiff : soft});
      const double moved_m = leaves ? 8e-5 : -8e-5;
      const Vec3 before_N = rig.force;
      rig.hand.position_m.y() += moved_m;
      rig.step();
      worked_J[yields] += 0.5 * (before_N + rig.force).y() * moved_m;
      held = held || (rig.out.status & kRemoteCorrectionsHeld) != 0;
    }
    EXPECT_EQ(held, !yields);
  }
  EXPECT_GT(worked_J[1], 0.1);
  EXPECT_LT(worked_J[0], 0.020 + 2.1 * 0.020 + 0.005)
      << "the start, the refill, and what the spring had stored";
}

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

// The law of remote contacts against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/time.h"
#include "realtime/remote/normal_shares.h"
#include "realtime/remote/remote_contacts.h"
#include "realtime/remote/remote_input.h"
#include "realtime/servo/remote_rig.h"
#include "reduced.h"

namespace hapticd::realtime {
namespace {

void expectNear(const Vec3& a, const Vec3& b, double tolerance) {
  EXPECT_LE((a - b).norm(), tolerance) << a.transpose() << " instead of " << b.transpose();
}

TEST(RemoteContacts, HalfSpaceIsASpringFromTheFirstTouch) {
  RemoteRig rig;
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
  RemoteRig rig;
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
  RemoteRig hollow;
  ball.radius_m = -0.030;
  ball.normal = -Vec3::UnitY();
  hollow.approach({ball}, {0.028, 0, 0}, {0.0315, 0, 0});
  expectNear(hollow.force, {-800 * 0.0015, 0, 0}, 1e-6);
}

TEST(RemoteContacts, CylinderIsFlatAlongItsAxis) {
  RemoteRig rig;
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
  RemoteRig rig;
  rig.hand.position_m = {0, -0.001, 0};
  RemoteContact rising = floorAt(-0.002);
  rising.point_m.setZero();
  rising.point_m.y() = -0.002;
  rising.velocity_m_per_s = {0, 0.1, 0};
  rig.state({rising});
  for (int ms = 1; ms <= 30; ++ms)
    expectNear(rig.step(), {0, 800 * std::max(0.0, 1e-4 * ms - 0.001), 0}, 1e-9);

  RemoteRig turning;
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
  RemoteRig other;
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
      RemoteRig rig;
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
    RemoteRig rig;
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

TEST(RemoteContacts, SurfacesOnTopOfEachOtherAreAsStiffAsOne) {
  RemoteRig rig;
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
    RemoteRig rig;
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
  RemoteRig rig;
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
  RemoteRig rig;
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
  RemoteRig rig;
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
    RemoteRig rig;
    const Nanos began = rig.now;
    const auto travelled = [&](Nanos at) { return kSpeed_m_per_s * base::toSeconds(at - began); };
    double held_N = 0;
    for (int i = 0; i < 1500; ++i) {
      if (i % 10 == 0) {
        RemoteContact belt = floorAt(0, 1000);
        belt.staticFriction = belt.dynamicFriction = 0.8;
        belt.velocity_m_per_s.x() = kSpeed_m_per_s;
        rig.state({belt});
      }
      const Nanos lateNow = i > 600 && i % 50 == 0 ? late : 0;
      // On the belt the hand strains forward, and then rides along.
      const double ahead_m = 1e-6 * std::clamp(i - 300, 0, 200);
      rig.hand.velocity_m_per_s.x() = kSpeed_m_per_s;
      rig.hand.position_m = {travelled(rig.now + kMs + lateNow) + ahead_m, std::max(-0.002, 0.002 - 2e-5 * i),
                             0};
      rig.step(lateNow);
      if (i <= 600) held_N = rig.force.x();
      ASSERT_NEAR(rig.force.x(), i < 300 ? 0 : held_N, 1e-6)
          << "tick " << i << ", late by " << late / kMs << " ms";
    }
    EXPECT_LT(held_N, -0.05);
    EXPECT_NEAR(rig.force.y(), 2, 1e-6);
  }
}

// Below a hand at rest it stretches the spring of friction by its way, however few ticks that takes.
TEST(RemoteContacts, FrictionOfAMovingSurfaceGrowsInLateTicks) {
  RemoteContact belt = floorAt(0, 1000);
  belt.staticFriction = belt.dynamicFriction = 0.8;
  belt.velocity_m_per_s.x() = 2e-4;
  const auto draggedBy = [&](Nanos late) {
    RemoteRig rig;
    rig.approach({belt}, {0, 0.002, 0}, {0, -0.002, 0});
    const Nanos end = rig.now + 500 * kMs;
    for (int i = 0; rig.now < end; ++i) {
      if (i % 10 == 0) rig.state({belt});
      rig.step(i % 20 == 0 ? std::min(late, end - rig.now - kMs) : 0);
    }
    return rig.force.x();
  };
  const double inTime_N = draggedBy(0);
  EXPECT_GT(inTime_N, 0.05);
  for (const Nanos late : {2 * kMs, 5 * kMs, 14 * kMs}) EXPECT_NEAR(draggedBy(late), inTime_N, 1e-6);
}

// A recording that begins between both does not know that the view moved: it must not matter.
TEST(RemoteContacts, AViewThatMovedBeforeThemDoesNotMoveThem) {
  RemoteRig rig;
  rig.hand.position_m = {0, 0.001, 0};
  rig.law.moveWithView(geometry::Affine::Identity());
  rig.step();
  rig.settle({floorAt(0)}, 1);
  EXPECT_TRUE(rig.law.rest());
}

TEST(RemoteContacts, TheSlowestTurnIsNone) {
  RemoteContact floor = floorAt(0);
  floor.angularVelocity_rad_per_s = {1e-321, 0, 1e-200};  // whose norm is 0 in double precision
  RemoteRig rig;
  rig.approach({floor}, {0, 0.01, 0}, {0, -0.001, 0});
  rig.settle({floor}, 100);
  EXPECT_NEAR(rig.force.y(), 0.8, kExact_N);
  EXPECT_TRUE(rig.force.allFinite());
}

// A body that comes to rest in a simulation: its velocity falls through the smallest numbers, whose norm is
// 0.
TEST(RemoteContacts, SurfacesThatComeToRestStayFelt) {
  RemoteRig rig;
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
  RemoteRig rig;
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
    RemoteRig rig;
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
    RemoteRig rig;
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

}  // namespace
}  // namespace hapticd::realtime

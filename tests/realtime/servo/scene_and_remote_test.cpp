// Surfaces of the scene and of a client, felt together.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "realtime/servo/fakes.h"
#include "realtime/servo/tick.h"
#include "reduced.h"

namespace hapticd::realtime {
namespace {

// Planes of the scene and half-spaces that a client states at 100 Hz, all through the origin, and a hand that
// goes where the test says, or an arm of 0.1 kg that nobody holds.
class SharedPit {
 public:
  std::vector<scene::Plane> planes;
  std::vector<RemoteContact> contacts;
  Vec3 x_m = Vec3(0, 0.004, 0);
  Vec3 v_m_per_s = Vec3::Zero();
  double damping_Ns_per_m = 0.1;
  double weight_N = 0;
  Affine T_world_device = Affine::Identity();

  explicit SharedPit(double bareDamping_Ns_per_m = std::numeric_limits<double>::infinity(),
                     bool guarded = true)
      : tick_(device_, clock_, options(bareDamping_Ns_per_m, guarded)) {}

  void addToScene(const Vec3& normal, double stiffness_N_per_m, double friction = 0) {
    scene::Plane plane;
    plane.index = static_cast<std::int32_t>(planes.size());
    plane.normal = normal;
    plane.surface.stiffness_N_per_m = stiffness_N_per_m;
    plane.surface.staticFriction = plane.surface.dynamicFriction = friction;
    planes.push_back(plane);
  }
  void addRemote(const Vec3& normal, double stiffness_N_per_m, double friction = 0) {
    RemoteContact contact;
    contact.id = static_cast<std::int32_t>(contacts.size());
    contact.normal = normal;
    contact.stiffness_N_per_m = stiffness_N_per_m;
    contact.staticFriction = contact.dynamicFriction = friction;
    contacts.push_back(contact);
  }
  const TickReport& at(const Vec3& to_m) {
    v_m_per_s = (to_m - x_m) * 1e3;
    x_m = to_m;
    return step();
  }
  const TickReport& letGo() {
    constexpr int kParts = 20;
    constexpr double kPart_s = 1e-3 / kParts;
    constexpr double kMass_kg = 0.1;
    step();
    for (int i = 0; i < kParts; ++i) {
      Vec3 force = tick_.last().force_N - Vec3(0, weight_N, 0) - damping_Ns_per_m * v_m_per_s;
      const double speed = v_m_per_s.norm();
      if (speed > 0) force -= std::min(kCoulomb_N, speed * kMass_kg / kPart_s) / speed * v_m_per_s;
      v_m_per_s += kPart_s / kMass_kg * force;
      x_m += kPart_s * v_m_per_s;
    }
    return tick_.last();
  }

 private:
  static constexpr double kCoulomb_N = 0.02;

  TickOptions options(double bareDamping_Ns_per_m, bool guarded) const {
    TickOptions options;
    options.guard = GuardOptions::of(device_.profile());
    options.guard.enabled = guarded;
    options.guard.rampIn = 0;
    options.guard.peakForce_N = options.guard.continuousForce_N = 20;
    options.render.bareDamping_Ns_per_m = bareDamping_Ns_per_m;
    return options;
  }
  const TickReport& step() {
    const Affine T_device_world = (ms_ == 0 ? T_world_device : tick_.last().T_world_device).inverse();
    if (ms_ == 0 || T_world_device.matrix() != published_.matrix()) publish();
    const Nanos now = (1000 + ms_) * 1'000'000LL;
    if (ms_ % 10 == 0) {
      RemoteContactSet& set = input_.contacts;
      ++set.number;
      set.received = set.stated = now;
      set.count = static_cast<std::uint32_t>(contacts.size());
      // As the server states them, in the view of the last tick.
      for (std::size_t i = 0; i < contacts.size(); ++i) {
        RemoteContact& contact = set.contacts[i] = contacts[i];
        contact.point_m = T_device_world * contact.point_m;
        contact.normal = (T_device_world.linear() * contact.normal).normalized();
      }
      tick_.remote().write(input_);
    }
    ++ms_;
    device_.state.position_m = x_m;
    device_.state.velocity_m_per_s = v_m_per_s;
    tick_(now);
    tick_.reports().consume([](const TickReport&) {});
    return tick_.last();
  }
  void publish() {
    auto snapshot = std::make_shared<scene::SceneSnapshot>();
    snapshot->revision = ++revision_;
    snapshot->planes = planes;
    snapshot->workspace.T_world_device = published_ = T_world_device;
    snapshot->workspace.T_device_world = T_world_device.inverse();
    snapshot->workspace.worldUnitsPerMetre = 1;
    tick_.snapshots().publish(std::move(snapshot));
  }

  FakeDevice device_;
  FakeClock clock_;
  Tick tick_;
  RemoteInput input_;
  Affine published_ = Affine::Identity();
  std::uint64_t revision_ = 0;
  long long ms_ = 0;
};

Vec3 leaning(double angle) {
  return {std::sin(angle), std::cos(angle), 0};
}

// The hand on a circle inside both walls: they take as much as they give, on a way round in either sense.
TEST(SceneAndRemote, walls_of_both_give_no_energy) {
  constexpr double kRadius_m = 0.002;
  constexpr int kRound = 2000;
  const Vec3 centre_m(0, -0.0035, 0);
  for (const double degrees : {20.0, 40.0, 60.0, 80.0}) {
    for (const auto& [ofScene, ofRemote] : {std::pair{1000.0, 1000.0}, {500.0, 1000.0}, {1000.0, 500.0}}) {
      for (const double sense : {1.0, -1.0}) {
        SharedPit pit(std::numeric_limits<double>::infinity(), false);
        const double lean = 0.5 * degrees * M_PI / 180;
        pit.addToScene(leaning(lean), ofScene);
        pit.addRemote(leaning(-lean), ofRemote);
        for (double y = 0.003; y > centre_m.y() + kRadius_m; y -= 1e-5) pit.at({0, y, 0});
        double work_J = 0;
        double largest_N = 0;
        Vec3 before_N = Vec3::Zero();
        for (int i = 0; i < 3 * kRound; ++i) {
          const double angle = sense * 2 * M_PI * i / kRound;
          const Vec3 to_m = centre_m + kRadius_m * Vec3(std::sin(angle), std::cos(angle), 0);
          const Vec3 way_m = to_m - pit.x_m;
          const Vec3 force_N = pit.at(to_m).rendering.force_N;
          if (i > kRound) work_J += 0.5 * (before_N + force_N).dot(way_m);
          before_N = force_N;
          largest_N = std::max(largest_N, force_N.norm());
        }
        EXPECT_GT(largest_N, 1);
        EXPECT_NEAR(work_J, 0, 1e-5) << degrees << " degrees, " << ofScene << " and " << ofRemote << " N/m";
      }
    }
  }
}

TEST(SceneAndRemote, arm_that_is_let_go_between_walls_of_both_comes_to_rest) {
  for (unsigned seed = 0; seed < static_cast<unsigned>(reduced(20)); ++seed) {
    std::mt19937 random(seed);
    const auto draw = [&](double from, double to) { return from + (to - from) * random() / 4294967296.0; };
    SharedPit pit(0.1);
    pit.weight_N = 1.5;
    const int walls = 3 + static_cast<int>(seed % 3);
    for (int i = 0; i < walls; ++i) {
      const double around = 2 * M_PI * (i + draw(-0.2, 0.2)) / walls;
      const double up = draw(0.3, 1.1);
      const Vec3 normal(std::cos(around) * std::cos(up), std::sin(up), std::sin(around) * std::cos(up));
      const double stiffness = draw(300, 1000);
      if (i % 2 == 0) {
        pit.addToScene(normal, stiffness);
      } else {
        pit.addRemote(normal, stiffness);
      }
    }
    pit.x_m = Vec3(draw(-0.002, 0.002), 0.004, draw(-0.002, 0.002));
    for (int ms = 0; ms < 8000; ++ms) pit.letGo();
    double fastest = 0;
    for (int ms = 0; ms < 1000; ++ms) {
      pit.letGo();
      fastest = std::max(fastest, pit.v_m_per_s.norm());
    }
    EXPECT_LT(fastest, 0.005) << "seed " << seed;
  }
}

// A stiffer remote face on a face of the scene takes its force over, and its friction only for what it adds.
TEST(SceneAndRemote, friction_of_a_surface_that_both_know_is_felt_once) {
  for (const double ofRemote : {500.0, 1000.0, 1500.0}) {
    SharedPit pit;
    pit.addToScene(Vec3::UnitY(), 1000, 0.5);
    pit.addRemote(Vec3::UnitY(), ofRemote, 0.5);
    for (double y = 0.001; y > -0.002; y -= 2e-5) pit.at({0, y, 0});
    for (int i = 0; i < 400; ++i) pit.at(pit.x_m + Vec3(2e-5, 0, 0));
    const Vec3 force_N = pit.at(pit.x_m + Vec3(2e-5, 0, 0)).rendering.force_N;
    EXPECT_NEAR(force_N.y(), std::max(1000.0, ofRemote) * -pit.x_m.y(), 1e-6);
    EXPECT_NEAR(-force_N.x(), 0.5 * force_N.y(), 1e-3 * force_N.y()) << ofRemote << " N/m";
  }
}

// The guard lets the sum of both grow by its rate.
TEST(SceneAndRemote, table_that_both_know_does_not_throw_a_fast_arm_back_faster) {
  for (const double stiffness : {2000.0, 5000.0}) {
    for (const double speed : {0.3, 0.5, 0.8, 1.0}) {
      SharedPit pit;
      pit.damping_Ns_per_m = 0.3;
      pit.addToScene(Vec3::UnitY(), stiffness);
      pit.addRemote(Vec3::UnitY(), stiffness);
      for (int ms = 0; ms < 200; ++ms) pit.at({0.001, 0.03, 0.002});
      pit.v_m_per_s = Vec3(0, -speed, 0);
      double in_m_per_s = 0;
      while (pit.x_m.y() > 0) {
        in_m_per_s = -pit.v_m_per_s.y();
        pit.letGo();
      }
      for (int ms = 0; ms < 300 && pit.x_m.y() <= 0; ++ms) pit.letGo();
      EXPECT_GT(pit.v_m_per_s.y(), 0);
      EXPECT_LT(pit.v_m_per_s.y(), 1.17 * in_m_per_s) << stiffness << " N/m, " << speed << " m/s";
    }
  }
}

// A view that slides, sinks or turns, as at 60 Hz, and the hand with it: in the world nothing moves.
TEST(RemoteContactsInAView, rest_in_the_world) {
  for (const Vec3& speed_m_per_s : {Vec3(0.03, 0, 0), Vec3(0, -0.03, 0), Vec3(0.02, 0.02, -0.01)}) {
    for (const double turning_rad_per_s : {0.0, 0.5}) {
      SharedPit pit;
      pit.addRemote(Vec3::UnitY(), 1000, 0.5);
      double steepest_N = 0;
      Vec3 before_N = Vec3::Zero();
      for (int ms = 0; ms < 2000; ++ms) {
        if (ms >= 500 && ms % 16 == 0) {
          const double time_s = 1e-3 * (ms - 500);
          pit.T_world_device = Eigen::Translation3d(time_s * speed_m_per_s) *
                               Eigen::AngleAxisd(turning_rad_per_s * time_s, Vec3(1, 2, -1).normalized());
        }
        const Vec3 place_m(0, std::max(-0.002, 0.002 - 2e-5 * ms), 0);
        const TickReport& tick = pit.at(pit.T_world_device.inverse() * place_m);
        const Vec3 force_N = pit.T_world_device.linear() * tick.rendering.force_N;
        if (ms >= 500) {
          ASSERT_NEAR(force_N.y(), 2, 1e-6) << speed_m_per_s.transpose() << ", " << ms << " ms";
          ASSERT_NEAR(std::hypot(force_N.x(), force_N.z()), 0, 1e-6) << ms << " ms";
          ASSERT_EQ(tick.remote.status & kRemoteCorrectionsHeld, 0U);
          steepest_N = std::max(steepest_N, (tick.force_N - before_N).norm());
        }
        before_N = tick.force_N;
      }
      EXPECT_LT(steepest_N, 0.1);
    }
  }
}

// A hand that rests on the device, and a view that takes it into a surface and out again.
TEST(RemoteContactsInAView, press_as_deep_as_the_view_takes_the_hand) {
  SharedPit pit;
  pit.addRemote(Vec3::UnitY(), 800);
  for (int ms = 0; ms < 3000; ++ms) {
    const double dip_m = ms < 800 ? 0 : 0.00075 * (1 - std::cos(2 * M_PI * 1e-3 * (ms - 800) / 0.8));
    if (ms % 16 == 0) pit.T_world_device = Eigen::Translation3d(0, -dip_m, 0) * Affine::Identity();
    const TickReport& tick = pit.at({0, std::max(-0.001, 0.002 - 2e-5 * ms), 0});
    const double depth_m = std::max(0.0, -(pit.T_world_device * pit.x_m).y());
    ASSERT_NEAR(tick.rendering.force_N.y(), 800 * depth_m, 1e-6) << ms << " ms";
  }
}

}  // namespace
}  // namespace hapticd::realtime

// Friction in metres and seconds: the same at every rate of the servo, without drift, and per contact.
#include <gtest/gtest.h>

#include <random>

#include "meshes.h"
#include "reduced.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

// A renderer at a rate of its own.
class LoopAtRate {
 public:
  LoopAtRate(std::shared_ptr<const scene::SceneSnapshot> scene, double rate_Hz,
             const RenderOptions& options = {})
      : scene_(std::move(scene)), renderer_(options), period_(toNanos(1 / rate_Hz)) {}

  const Rendering& at(const Vec3& p) {
    device::DeviceState state;
    state.time = now_;
    state.position_m = p;
    state.velocity_m_per_s = now_ > 0 ? Vec3((p - last_) / base::toSeconds(period_)) : Vec3(Vec3::Zero());
    renderer_.step(*scene_, state, now_, period_, rendering_);
    last_ = p;
    now_ += period_;
    return rendering_;
  }
  // On a straight line to p; calls `each` after every tick.
  template <class Each>
  void to(const Vec3& p, double speed, Each&& each) {
    const Vec3 from = last_;
    const int ticks =
        std::max(1, static_cast<int>(std::lround((p - from).norm() / speed / base::toSeconds(period_))));
    for (int i = 1; i <= ticks; ++i) each(at(from + (p - from) * (static_cast<double>(i) / ticks)));
  }
  void to(const Vec3& p, double speed = 0.1) {
    to(p, speed, [](const Rendering&) {});
  }
  const Rendering& now() const { return rendering_; }

 private:
  std::shared_ptr<const scene::SceneSnapshot> scene_;
  Renderer renderer_;
  Nanos period_;
  Nanos now_ = 0;
  Vec3 last_ = Vec3::Zero();
  Rendering rendering_;
};

constexpr double kRates_Hz[] = {250, 1000, 4000};

// 1 mm deep on a plate with mu 0.5 and 0.3: after the breakaway the force is 0.3 N at any speed and rate.
TEST(SlowSliding, force_does_not_depend_on_the_rate) {
  SceneFixture scene;
  scene.add(plane(0.05, 40), surface(1000, 0.5, 0.3));
  for (const double speed : {0.05e-3, 0.2e-3, 1e-3, 5e-3, 50e-3}) {
    for (const double rate : kRates_Hz) {
      LoopAtRate loop(scene.snapshot(), rate);
      loop.at({0, 0.0002, 0.001});
      loop.to({0, 0.0002, -0.001});
      loop.to({0.00045, 0.0002, -0.001}, 0.01);
      // The last part of the way to the breakaway, then 0.25 mm of sliding.
      double slid = 0;
      double least = 1;
      double most = 0;
      const Vec3 held = loop.now().proxy_m;
      loop.to({0.00075, 0.0002, -0.001}, speed, [&](const Rendering& r) {
        if ((r.proxy_m - held).norm() < 1e-9) return;
        slid = (r.proxy_m - held).norm();
        least = std::min(least, -r.force_N.x());
        most = std::max(most, -r.force_N.x());
      });
      EXPECT_GT(slid, 0.0003);
      EXPECT_GT(least, 0.98 * 0.3) << speed << " m/s at " << rate << " Hz";
      EXPECT_LT(most, 1.02 * 0.3) << speed << " m/s at " << rate << " Hz";
    }
  }
}

// A pause of 0.1 s does not end the slide, one of 0.3 s does: static friction again.
TEST(SlowSliding, slide_ends_after_a_pause_in_seconds) {
  SceneFixture scene;
  scene.add(plane(0.05, 40), surface(1000, 0.5, 0.3));
  for (const double rate : kRates_Hz) {
    for (const double pause_s : {0.1, 0.3}) {
      LoopAtRate loop(scene.snapshot(), rate);
      loop.at({0, 0.0002, 0.001});
      loop.to({0, 0.0002, -0.001});
      loop.to({0.002, 0.0002, -0.001}, 0.01);
      EXPECT_NEAR(-loop.now().force_N.x(), 0.3, 1e-6);
      for (int i = 0; i < static_cast<int>(pause_s * rate); ++i) loop.at({0.002, 0.0002, -0.001});
      EXPECT_NEAR(-loop.now().force_N.x(), 0.3, 1e-6);
      loop.to({0.0021, 0.0002, -0.001}, 0.01);
      EXPECT_NEAR(-loop.now().force_N.x(), pause_s > 0.2 ? 0.4 : 0.3, 1e-6) << rate;
    }
  }
}

// A trembling hand that leans on the friction, 20 um in all directions: the proxy stays.
TEST(SlowSliding, tremor_does_not_move_the_proxy) {
  SceneFixture scene;
  scene.add(plane(0.05, 40), surface(1000, 0.5, 0.3));
  for (const double lean : {0.0, 0.00028, 0.0006}) {  // resting, near the dynamic bound, sliding at first
    LoopAtRate loop(scene.snapshot(), 1000);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> tremor(-20e-6, 20e-6);
    loop.at({0, 0.0002, 0.001});
    loop.to({0, 0.0002, -0.001});
    loop.to({lean, 0.0002, -0.001}, 0.01);
    const auto tick = [&] {
      loop.at({lean + tremor(random), 0.0002 + tremor(random), -0.001 + tremor(random)});
    };
    for (int i = 0; i < 1000; ++i) tick();
    const Vec3 held = loop.now().proxy_m;
    double drift = 0;
    for (int i = 0; i < reduced(1'000'000); ++i) {
      tick();
      drift = std::max(drift, (loop.now().proxy_m - held).norm());
    }
    EXPECT_LT(drift, 1e-6) << lean;
  }
}

// Cycles of every size, speed and direction: friction takes energy or none.
TEST(SlowSliding, cycles_give_no_energy) {
  SceneFixture scene;
  scene.add(plane(0.05, 40), surface(1000, 0.5, 0.3));
  std::mt19937 random(6);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  for (int i = 0; i < reduced(60, 6); ++i) {
    RenderOptions options;
    options.stribeckSpeed_m_per_s = i % 2 == 0 ? 0 : uniform(1e-4, 1e-2);
    LoopAtRate loop(scene.snapshot(), kRates_Hz[i % 3], options);
    const double size = std::exp(uniform(std::log(1e-5), std::log(3e-3)));
    const int steps = static_cast<int>(std::exp(uniform(std::log(50.0), std::log(20'000.0))));
    const double phase = uniform(0, 6);
    const auto path = [&](double a) {
      return Vec3(size * std::cos(a), 0.5 * size * std::sin(2 * a + phase),
                  -0.001 + 0.0005 * std::sin(a + phase));
    };
    loop.at({size, 0, 0.001});
    loop.to(path(0));
    double work = 0;
    for (int turn = 0; turn < 3; ++turn) {
      work = 0;
      Vec3 last = path(0);
      Vec3 lastForce = loop.now().force_N;
      for (int k = 1; k <= steps; ++k) {
        const Vec3 p = path(2 * M_PI * (k % steps) / steps);
        const Vec3 force = loop.at(p).force_N;
        work += 0.5 * (force + lastForce).dot(p - last);
        last = p;
        lastForce = force;
      }
    }
    EXPECT_LE(work, 1e-9) << "size " << size << " in " << steps << " steps";
  }
}

// The Stribeck curve: mu falls from 0.5 to 0.3 with the speed, at every rate alike.
TEST(SlowSliding, stribeck_curve_follows_the_speed) {
  SceneFixture scene;
  scene.add(plane(0.05, 40), surface(1000, 0.5, 0.3));
  RenderOptions options;
  options.stribeckSpeed_m_per_s = 0.02;
  for (const double speed : {0.002, 0.01, 0.02, 0.06}) {
    const double mu = 0.3 + 0.2 * std::exp(-std::pow(speed / 0.02, 2));
    for (const double rate : kRates_Hz) {
      LoopAtRate loop(scene.snapshot(), rate, options);
      loop.at({-0.03, 0.0002, 0.001});
      loop.to({-0.03, 0.0002, -0.001});
      loop.to({-0.03 + std::max(0.002, 0.5 * speed), 0.0002, -0.001}, speed);
      EXPECT_NEAR(-loop.now().force_N.x(), mu, 0.02 * mu) << speed << " m/s at " << rate << " Hz";
    }
  }
}

// Two walls that enclose an angle: a stroke along the groove meets mu (N1 + N2), not mu |N1 + N2|. The
// resultant is 1.2 N and mu 0.5.
TEST(GrooveFriction, each_wall_bears_its_own) {
  for (const double degrees : {60.0, 30.0, 10.0}) {
    const double half = 0.5 * degrees * M_PI / 180;
    SceneFixture scene;
    for (const double side : {-1.0, 1.0}) {
      TriangleMesh wall;
      const Vec3 up(side * std::sin(half), 0, std::cos(half));
      for (const Vec3& v : {Vec3(0, -0.1, 0), Vec3(0, 0.1, 0), Vec3(0.04 * up + Vec3(0, 0.1, 0)),
                            Vec3(0.04 * up - Vec3(0, 0.1, 0))}) {
        wall.vertices.push_back(v.cast<float>());
      }
      wall.triangles = {{0, 1, 2}, {0, 2, 3}};
      if (side > 0) wall.triangles = {{0, 2, 1}, {0, 3, 2}};
      scene.add(wall, surface(1000, 0.5, 0.5));
    }
    Hand hand(scene.snapshot());
    hand.at({0, -0.05, 0.01});
    hand.to({0, -0.05, -0.0012});
    const Rendering& r = hand.to({0, 0.04, -0.0012}, 0.05);
    EXPECT_NEAR(r.depth_m, 0.0012, 1e-8);
    ASSERT_EQ(r.contactCount, 2U);
    const double coulomb = 0.5 * 1.2 / std::sin(half);
    EXPECT_NEAR(-r.force_N.y(), coulomb, 1e-3 * coulomb) << degrees;
    for (int i = 0; i < 2; ++i) {
      const Contact& c = r.contacts[static_cast<std::size_t>(i)];
      const double normal = c.force_N.dot(c.normal);
      EXPECT_NEAR(-c.force_N.y(), 0.5 * normal, 1e-3 * normal) << degrees;
    }
  }
}

// A rough wall and a smooth one: the rough one alone bears the friction, by its own normal force.
TEST(GrooveFriction, smooth_wall_bears_none) {
  SceneFixture scene;
  scene::Plane wall;
  wall.surface = surface(1000, 0.6, 0.6);
  wall.normal = Vec3(1, 0, 1).normalized();
  scene.planes.push_back(wall);
  scene.add(plane(0.2, 4), surface(1000));
  Hand hand(scene.snapshot());
  hand.at({0.03, -0.05, 0.02});
  hand.to({-0.0002, -0.05, -0.001});
  const Rendering& r = hand.to({-0.0002, 0.05, -0.001}, 0.05);
  ASSERT_EQ(r.contactCount, 2U);
  for (int i = 0; i < 2; ++i) {
    const Contact& c = r.contacts[static_cast<std::size_t>(i)];
    const double normal = c.force_N.dot(c.normal);
    EXPECT_GT(normal, 0.1);
    EXPECT_NEAR(-c.force_N.y(), c.object < 0 ? 0.6 * normal : 0, 1e-6);
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture

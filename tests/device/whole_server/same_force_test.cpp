// The demo scene, uploaded over the network, on every device: the force that arrives there is the simulated
// device's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <optional>
#include <sstream>
#include <string>

#include "base/time.h"
#include "device/haply/mock_service.h"
#include "device/simulated/hand_file.h"
#include "device/whole_server/event_kernel.h"
#include "device/whole_server/served_device.h"

namespace hapticd::whole_server {
namespace {

constexpr double kShare = 0.01;
constexpr double kRounding_N = 1e-6;

bool same(const Vec3& force, const Vec3& expected) {
  return (force - expected).norm() <= kShare * expected.norm() + kRounding_N;
}

/// Less of it, in the same direction: a guard that ramps in. More, or another direction, is wrong.
bool partOf(const Vec3& force, const Vec3& expected) {
  const double share = force.dot(expected) / expected.squaredNorm();
  return share > -kShare && share < 1 + kShare &&
         (force - share * expected).norm() <= kShare * expected.norm() + kRounding_N;
}

/// In ticks, from a place to the force that answers it.
struct Delay {
  int least = 0;
  int most = 0;
};

/// Reads the log of a mock as the hand goes round, until the force was right at every place of the stroke.
class Comparison {
 public:
  /// The force of a tick belongs to a place from `least` to `most` ticks before.
  Comparison(const SharedArm& arm, std::vector<Vec3> expected, Delay delay)
      : arm_(arm),
        expected_(std::move(expected)),
        delay_(delay),
        right_(expected_.size()),
        next_(arm->ticks) {}

  void read() {
    for (const std::int64_t end = arm_->ticks; next_ < end; ++next_) {
      const Vec3 force = arm_.force(next_);
      bool good = false;
      for (int delay = delay_.least; delay <= delay_.most; ++delay) {
        const std::size_t earlier = placeOf(next_ - delay);
        if (!same(force, expected_[earlier])) continue;
        if (!right_[earlier]) ++places_;
        right_[earlier] = good = true;
      }
      const std::size_t place = placeOf(next_ - delay_.least);
      ++ticks_;
      equal_ += good ? 1 : 0;
      if (good || partOf(force, expected_[place])) continue;
      if (wrong_++ == 0) {
        words_ << "tick " << next_ << ", place " << place << ": " << force.transpose() << " N instead of "
               << expected_[place].transpose();
      }
    }
  }
  bool complete() const { return places_ == right_.size(); }
  std::size_t places() const { return places_; }
  int wrong() const { return wrong_; }
  std::string words() const { return words_.str(); }
  void print(const char* name) const {
    std::printf(
        "%s: right at %zu of %zu places; %d ticks, %d of them equal within 1 %%, %d otherwise wrong\n", name,
        places_, right_.size(), ticks_, equal_, wrong_);
  }

 private:
  std::size_t placeOf(std::int64_t tick) const { return static_cast<std::size_t>(arm_.at(tick).place); }

  const SharedArm& arm_;
  const std::vector<Vec3> expected_;
  const Delay delay_;
  std::vector<bool> right_;
  std::int64_t next_;
  std::size_t places_ = 0;
  int ticks_ = 0;
  int equal_ = 0;
  int wrong_ = 0;
  std::ostringstream words_;
};

class SameForce : public testing::Test {
 protected:
  void SetUp() override {
    scene.script(*arm);
    const std::vector<Vec3> forces = scene.strokeForces();
    double most = 0;
    for (const Vec3& f : forces) most = std::max(most, f.norm());
    ASSERT_GT(most, 0.5) << "the stroke touches";
  }
  // A server with the scene in it, the hand at rest in the air.
  void serve(const std::vector<std::string>& arguments, const std::vector<std::string>& environment) {
    server.emplace(work, arguments, environment);
    const std::string address = server->address();
    ASSERT_FALSE(address.empty()) << server->log();
    visitor.emplace(address);
    scene.upload(visitor->client());
    ASSERT_TRUE(visitor->untilReady()) << server->log();
  }
  void compare(const char* name, bool everyTick, Delay delay) {
    if (!visitor) return;  // there is no server
    // The spring is felt in the air as soon as the scene is complete.
    const std::vector<Vec3> expected = scene.strokeForces();
    ASSERT_TRUE(visitor->until([&] {
      visitor->untilReady();
      return arm->ticks > 0 && same(arm.force(arm->ticks - 1), expected[0]);
    })) << arm.left().transpose()
        << " instead of " << expected[0].transpose() << "\n"
        << server->log();
    Comparison comparison(arm, expected, delay);
    arm->rest = -1;
    EXPECT_TRUE(visitor->until([&] {
      if (visitor->latched()) visitor->client().rearmForces();
      comparison.read();
      return comparison.complete();
    }));
    comparison.print(name);
    EXPECT_EQ(comparison.places(), expected.size());
    if (everyTick) {
      EXPECT_EQ(comparison.wrong(), 0) << comparison.words();
    }
    server->signal(SIGTERM);
    EXPECT_EQ(server->end(), 0) << server->log();
    EXPECT_TRUE(arm.left().isZero());
  }

  DemoScene scene;
  const WorkDirectory work;
  const SharedArm arm{work.file("arm")};
  std::optional<ServerProcess> server;
  std::optional<Visitor> visitor;
};

TEST_F(SameForce, OpenHaptics) {
  serve({"--device", "openhaptics", "--in-process", "--enable-forces"},
        {"HAPTICD_HDAPI_LIB=" MOCK_HD, "HAPTICD_MOCK_ARM=" + work.file("arm")});
  compare("openhaptics", true, {0, 0});
}

TEST_F(SameForce, ForceDimension) {
  serve({"--device", "forcedimension", "--enable-forces"},
        {"HAPTICD_DHD_LIB=" MOCK_DRD, "HAPTICD_MOCK_ARM=" + work.file("arm")});
  compare("forcedimension", true, {0, 0});
}

// One tick later: each force is compared with the place that was told with the message before. Where a
// message and its answer take longer than a tick, the next force is already on its way: it belongs to the
// place before. A servo that the machine holds up for longer misses a place.
TEST_F(SameForce, Haply) {
  device::MockService service;
  service.follow(*arm);
  serve({"--device", "haply:127.0.0.1:" + service.port(), "--enable-forces"}, {});
  compare("haply", false, {0, 2});
}

// In a process of its own the link delays by a tick, too.
TEST_F(SameForce, OpenHapticsIsolated) {
  serve({"--device", "openhaptics", "--isolate", "--enable-forces"},
        {"HAPTICD_HDAPI_LIB=" MOCK_HD, "HAPTICD_MOCK_ARM=" + work.file("arm")});
  compare("openhaptics, isolated", false, {1, 3});
}

// The effects run on the device and USB is slow: the hand goes on when the force of its place has come.
TEST_F(SameForce, EvdevInItsPlane) {
  scene.stiffness = 0.15F;  // a joystick is soft
  scene.friction = false;   // which depends on how long the hand rests
  scene.depth_m = 0.012;
  scene.places = 60;
  constexpr double kTravel_m = 0.10;
  constexpr double kFullScale_N = 2;
  device::FakeJoystick joystick;
  EventKernel kernel(work.file("event0"), joystick);
  serve({"--device", "evdev:" + work.file("event0"), "--enable-forces"},
        {"LD_PRELOAD=" MOCK_EVENT, "HAPTICD_MOCK_EVENT=" + work.file("event0"),
         "ASAN_OPTIONS=verify_asan_link_order=0:detect_leaks=0"});
  // It moves in a plane.
  std::vector<Vec3> places = scene.stroke();
  for (Vec3& place : places) place.y() = 0;
  const std::vector<Vec3> expected = scene.forces(places);
  double most = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    kernel.move(2 * places[i].x() / kTravel_m, 2 * places[i].z() / kTravel_m);
    const auto error = [&] {
      const auto [x, z] = joystick.force();
      return std::hypot(x - expected[i].x() / kFullScale_N, z - expected[i].z() / kFullScale_N);
    };
    ASSERT_TRUE(visitor->until([&] {
      if (visitor->latched()) visitor->client().rearmForces();
      return error() <= 0.02;
    })) << "place "
        << i << ": off by " << error() << " of the full scale\n"
        << server->log();
    most = std::max(most, std::hypot(expected[i].x(), expected[i].z()));
  }
  EXPECT_GT(most, 0.5);
  server->signal(SIGTERM);
  EXPECT_EQ(server->end(), 0) << server->log();
  EXPECT_TRUE(eventually([&] { return joystick.isIdle(); }));
}

// When the recording began, on the clock of the ticks. That stands in no report: it is found from the lowest
// place.
base::Nanos beginOf(const device::HandPath& recording, const std::vector<TickReport>& ticks) {
  const auto lower = [](const TickReport& a, const TickReport& b) { return a.hand_m[2] < b.hand_m[2]; };
  const TickReport& lowest = *std::min_element(ticks.begin(), ticks.end(), lower);
  const Vec3 place(lowest.hand_m[0], lowest.hand_m[1], lowest.hand_m[2]);
  base::Nanos best = 0;
  double nearest = 1;
  for (base::Nanos at = 0; at <= recording.duration(); at += 1000) {
    const double distance = (recording.at(at).position_m - place).norm();
    if (distance < nearest) nearest = distance, best = at;
  }
  return lowest.tickTime.count() - best;
}

// What is reported is the recording, tick by tick, and the force that of the simulated device at the same
// places.
TEST_F(SameForce, ReplayIsItsRecording) {
  scene.friction = false;  // the force is then a function of the place alone
  const std::vector<Vec3> stroke = scene.stroke();
  std::ostringstream rows;
  rows << "t_s,x_m,y_m,z_m\n" << std::setprecision(12);
  const auto row = [&](double t_s, const Vec3& p) {
    rows << t_s << ',' << p.x() << ',' << p.y() << ',' << p.z() << '\n';
  };
  constexpr double kRest_s = 0.4;  // in the air after each stroke, for a scene to appear in
  const double stroke_s = 0.002 * static_cast<double>(stroke.size());
  for (std::size_t i = 0; i < stroke.size(); ++i) row(0.002 * static_cast<double>(i), stroke[i]);
  row(stroke_s, stroke[0]);
  row(stroke_s + kRest_s, stroke[0]);
  std::ofstream(work.file("hand.csv")) << rows.str();
  const auto recording = device::HandFile::parse(rows.str(), "hand");
  serve({"--device", "replay", "--hand", work.file("hand.csv")}, {});
  std::vector<TickReport> ticks;
  const auto inAir = [](const TickReport& tick) { return tick.hand_m[2] > 0.0015; };
  const auto isBehind = [&](const TickReport& tick) { return inAir(tick) && tick.proxy_m != tick.hand_m; };
  visitor->client().onTick([&](const TickReport& report) { ticks.push_back(report); });
  visitor->client().subscribe(Reports::tick, 1000);
  // Whole strokes, until the guard took nothing from one of them: a late tick costs half a second of ramp.
  const auto wholeStroke = static_cast<std::size_t>(1000 * (stroke_s + kRest_s));
  std::vector<Vec3> places;
  bool whole = false;
  bool gone = false;  // the scene, until it is sent again
  ASSERT_TRUE(visitor->until([&] {
    if (visitor->latched()) visitor->client().rearmForces();
    if (ticks.empty()) return false;
    // Sheets that appeared above the hand, or that it got behind while the servo stood still, hold it from
    // below. The same sheets sent again hold it, too, so they go first.
    if (isBehind(ticks.back()) && !gone) {
      visitor->client().resetScene();
      gone = true;
    } else if (gone && inAir(ticks.back()) && !isBehind(ticks.back())) {
      scene.upload(visitor->client());
      gone = false;
      ticks.clear();
    }
    if (gone) return false;
    ticks.erase(ticks.begin(), std::find_if(ticks.begin(), ticks.end(), inAir));
    if (ticks.size() < wholeStroke) return false;
    // A server that is behind skips reports or ticks, and the force belongs to the whole way.
    const auto gap = [](const TickReport& a, const TickReport& b) {
      return b.tick != a.tick + 1 || b.revision != a.revision || b.tickTime - a.tickTime > 3ms;
    };
    if (isBehind(ticks[0]) || std::adjacent_find(ticks.begin(), ticks.end(), gap) != ticks.end()) {
      ticks.clear();
      return false;
    }
    places.clear();
    for (const TickReport& tick : ticks) places.emplace_back(tick.hand_m[0], tick.hand_m[1], tick.hand_m[2]);
    const std::vector<Vec3> expected = scene.forces(places);
    whole = true;
    for (std::size_t i = 1; i < ticks.size(); ++i) {
      const Vec3 force(ticks[i].force_N[0], ticks[i].force_N[1], ticks[i].force_N[2]);
      if (same(force, expected[i])) continue;
      whole = false;
      EXPECT_TRUE(partOf(force, expected[i])) << "tick " << ticks[i].tick << ": " << force.transpose()
                                              << " instead of " << expected[i].transpose();
    }
    if (!whole) ticks.clear();
    return whole || HasFailure();
  })) << server->log();
  ASSERT_TRUE(whole);
  const base::Nanos round = recording->duration() + 1;
  const base::Nanos begin = beginOf(*recording, ticks);
  double far_m = 0;
  double most_N = 0;
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const Vec3 recorded = recording->at((ticks[i].tickTime.count() - begin + round) % round).position_m;
    far_m = std::max(far_m, (recorded - places[i]).norm());
    most_N = std::max(most_N, Vec3(ticks[i].force_N[0], ticks[i].force_N[1], ticks[i].force_N[2]).norm());
  }
  EXPECT_LT(far_m, 1e-6) << "a microsecond of the hand is less than a micrometre";
  EXPECT_GT(most_N, 0.5);
  std::printf("replay: %zu ticks, %.1e m from the recording at most\n", ticks.size(), far_m);
}

}  // namespace
}  // namespace hapticd::whole_server

#include "bench/remote_loop.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>

#include "base/clock.h"
#include "base/time.h"
#include "device/simulated/simulated_device.h"
#include "device/simulated/waypoint_path.h"

namespace hapticd::bench {
namespace {

using base::Nanos;
using geometry::Vec3;

constexpr double kSettled_m = 10e-6;
constexpr double kSoftest_N_per_m = 10;
constexpr double kStiffest_N_per_m = 20'000;
constexpr Nanos kEnd = 6'000'000'000;
constexpr Nanos kMeasured = 1'000'000'000;

std::shared_ptr<const scene::SceneSnapshot> localWall(double stiffness_N_per_m) {
  auto snapshot = std::make_shared<scene::SceneSnapshot>();
  snapshot->revision = 1;
  scene::Plane plane;
  plane.normal = Vec3::UnitY();
  plane.surface.stiffness_N_per_m = stiffness_N_per_m;
  snapshot->planes.push_back(plane);
  return snapshot;
}

// A client with a clock of its own behind two delays.
class Client {
 public:
  Client(double stiffness_N_per_m, const RemoteLoop& loop)
      : stiffness_N_per_m_(stiffness_N_per_m), loop_(loop), random_(loop.seed) {}

  void tick(Nanos now, double hand_m, realtime::Tick& servo) {
    states_.emplace_back(now + base::toNanos(loop_.delay_s), hand_m);
    while (!states_.empty() && states_.front().first <= now) {
      known_m_ = states_.front().second;
      states_.pop_front();
    }
    if (now >= next_) {
      const double period_s = 1 / loop_.rate_Hz + loop_.jitter_s * (2 * share_(random_) - 1);
      next_ += base::toNanos(period_s);
      if (share_(random_) >= loop_.loss)
        sent_.emplace_back(now + base::toNanos(loop_.delay_s), stiffness_N_per_m_ * std::max(0.0, -known_m_));
    }
    while (!sent_.empty() && sent_.front().first <= now) {
      force_N_ = sent_.front().second;
      sent_.pop_front();
      arrive(now, servo);
    }
  }
  double force_N() const { return force_N_; }

 private:
  void arrive(Nanos now, realtime::Tick& servo) {
    if (loop_.by == WallBy::remoteContact) {
      realtime::RemoteContactSet& set = input_.contacts;
      ++set.number;
      set.received = set.stated = now;
      set.count = 1;
      set.contacts[0].normal = Vec3::UnitY();
      set.contacts[0].stiffness_N_per_m = stiffness_N_per_m_;
    } else if (loop_.by == WallBy::tankedForce) {
      realtime::HeldForce& force = input_.force;
      ++force.number;
      force.received = now;
      force.lifetime = realtime::kLongestRemoteLife;
      force.force_N = {0, force_N_, 0};
    } else {
      return;
    }
    servo.remote().write(input_);
  }

  const double stiffness_N_per_m_;
  const RemoteLoop loop_;
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> share_{0, 1};
  std::deque<std::pair<Nanos, double>> states_;  // on their way to the client
  std::deque<std::pair<Nanos, double>> sent_;    // on their way to the server
  double known_m_ = 1;
  double force_N_ = 0;
  Nanos next_ = 0;
  realtime::RemoteInput input_;
};

}  // namespace

WallPress pressWall(double stiffness_N_per_m, const RemoteLoop& loop) {
  device::SimulatedOptions handOptions;
  handOptions.handDamping_Ns_per_m = loop.handDamping_Ns_per_m;
  device::SimulatedDevice hand(handOptions);
  hand.open();
  hand.setPath(std::make_shared<device::WaypointPath>(
      std::vector<device::Waypoint>{{0, {0, 0.005, 0}}, {0.5, {0, -0.008, 0}}}));
  base::SimulatedClock clock;
  realtime::TickOptions options;
  options.rate_Hz = loop.servo_Hz;
  options.guard.enabled = false;
  options.blackBox_s = 0;
  options.reports = 1;
  realtime::Tick tick(hand, clock, options);
  tick.snapshots().publish(loop.by == WallBy::local ? localWall(stiffness_N_per_m)
                                                    : std::make_shared<scene::SceneSnapshot>());
  Client client(stiffness_N_per_m, loop);
  WallPress result;
  double lowest = 1;
  double highest = -1;
  const auto period = static_cast<Nanos>(1e9 / loop.servo_Hz);
  for (Nanos now = 0; now < kEnd; now += period) {
    tick(now);
    tick.reports().consume([](const realtime::TickReport&) {});
    const double y = tick.last().device.position_m.y();
    result.force_N = tick.last().force_N.y();
    if (loop.by == WallBy::heldForce) {
      result.force_N = client.force_N();
      hand.write({0, client.force_N(), 0});
    }
    client.tick(now, y, tick);
    result.largestForce_N = std::max(result.largestForce_N, result.force_N);
    if (now < kEnd - kMeasured) continue;
    lowest = std::min(lowest, y);
    highest = std::max(highest, y);
  }
  tick.finish();
  result.peakToPeak_m = highest - lowest;
  return result;
}

bool settles(double stiffness_N_per_m, const RemoteLoop& loop) {
  return pressWall(stiffness_N_per_m, loop).peakToPeak_m < kSettled_m;
}

double stiffestWall(const RemoteLoop& loop) {
  double quiet = kSoftest_N_per_m;
  double buzzing = kStiffest_N_per_m;
  if (!settles(quiet, loop)) return 0;
  while (buzzing / quiet > 1.01) {
    const double middle = std::sqrt(quiet * buzzing);
    (settles(middle, loop) ? quiet : buzzing) = middle;
  }
  return quiet;
}

}  // namespace hapticd::bench

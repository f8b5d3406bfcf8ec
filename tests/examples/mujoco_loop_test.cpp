// The MuJoCo example in a closed loop with the servo and the simulated hand, in simulated time: what the hand
// gives to the scene must never fall below zero, although the physics runs a network away.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "base/clock.h"
#include "device/simulated/simulated_device.h"
#include "device/simulated/waypoint_path.h"
#include "examples/mujoco/hand_in_scene.h"
#include "realtime/servo/tick.h"
#include "reduced.h"
#include "server/station/streamed_input.h"

namespace hapticd {
namespace {

using base::Nanos;
using geometry::Vec3;

constexpr Nanos kTick = 1'000'000;
constexpr Nanos kFrame = 4 * kTick;
constexpr Nanos kWay = 2 * kTick;  // each way

std::array<double, 3> arrayOf(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

wire::RemoteContacts messageOf(const std::vector<RemoteContact>& surfaces, Nanos stateTime) {
  wire::RemoteContacts message;
  message.time = stateTime + 1;
  message.stateTime = stateTime;
  std::vector<double>& n = message.contacts.values;
  for (const RemoteContact& c : surfaces) {
    n.insert(n.end(), {static_cast<double>(c.id), static_cast<double>(c.shape), c.radius_m});
    for (const auto& v : {c.point_m, c.normal, c.axis, c.velocity_m_per_s, c.angularVelocity_rad_per_s})
      n.insert(n.end(), v.begin(), v.end());
    n.insert(n.end(), {c.stiffness_N_per_m, c.damping_Ns_per_m, c.staticFriction, c.dynamicFriction, 0.1,
                       c.yields ? 1.0 : 0.0});
  }
  return message;
}

struct State {
  Nanos time = 0;
  realtime::TickReport tick;
};

struct Felt {
  double least_J = 0;  // that the hand had given, at the worst moment
  double given_J = 0;  // at the end
  double strongest_N = 0;
  double steepest_N = 0;  // change of the force from one tick to the next
  double lowest_m = 1;    // of the touching hand
  int touchedTicks = 0;
  int ticks = 0;
};

Felt feel(const std::string& file, int ticks) {
  mujoco_example::HandInScene scene(HAPTICD_EXAMPLES "/mujoco/" + file);
  device::SimulatedDevice hand{device::SimulatedOptions{}};
  hand.open();
  std::vector<device::Waypoint> points;
  for (const auto& point : scene.path()) {
    const auto& p = point.position_m;
    points.push_back({point.time_s, {p[0], p[1], p[2]}});
  }
  hand.setPath(std::make_shared<device::WaypointPath>(points, device::WaypointPath::Repeat::yes));
  base::SimulatedClock clock;
  realtime::TickOptions options;
  options.guard.enabled = false;
  options.blackBox_s = 0;
  options.reports = 1;
  realtime::Tick tick(hand, clock, options);
  tick.snapshots().publish(std::make_shared<scene::SceneSnapshot>());
  scene::SceneConfig config;
  config.ownDamping_Ns_per_m = hand.profile().ownDamping_Ns_per_m;
  server::StreamedInput input(tick.remote(), config, {}, false);

  std::deque<State> toClient;
  std::deque<std::pair<Nanos, wire::RemoteContacts>> toServer;
  State known;
  Felt felt;
  Vec3 lastForce = Vec3::Zero(), lastPlace = points.front().position_m;
  for (int i = 0; i < ticks; ++i) {
    const Nanos now = i * kTick;
    while (!toServer.empty() && toServer.front().first <= now) {
      input.on(1, toServer.front().second, tick.last(), now);
      toServer.pop_front();
    }
    tick(now);
    tick.reports().consume([](const realtime::TickReport&) {});
    const realtime::TickReport& last = tick.last();
    felt.given_J -= lastForce.dot(last.device.position_m - lastPlace);  // the force is held for a tick
    felt.least_J = std::min(felt.least_J, felt.given_J);
    felt.strongest_N = std::max(felt.strongest_N, last.force_N.norm());
    felt.steepest_N = std::max(felt.steepest_N, (last.force_N - lastForce).norm());
    felt.touchedTicks += last.remote.count > 0;
    if (last.remote.count > 0) felt.lowest_m = std::min(felt.lowest_m, last.device.position_m.y());
    lastForce = last.force_N;
    lastPlace = last.device.position_m;
    toClient.push_back({now, last});
    while (!toClient.empty() && toClient.front().time + kWay <= now) {
      known = toClient.front();
      toClient.pop_front();
    }
    if (now % kFrame != 0 || known.tick.tick == 0) continue;
    if (now % base::toNanos(points.back().time_s) == 0) scene.reset();
    scene.setHand(arrayOf(known.tick.device.position_m), arrayOf(known.tick.device.velocity_m_per_s));
    std::vector<RemoteContactForce> forces;
    for (std::uint32_t c = 0; c < known.tick.remote.count; ++c) {
      const realtime::RemoteContactReport& report = known.tick.remote.contacts[c];
      forces.push_back({report.id, arrayOf(report.proxy_m.cast<double>()),
                        arrayOf(report.force_N.cast<double>()), report.depth_m});
    }
    scene.setForces(forces);
    scene.step(4e-3);
    toServer.emplace_back(now + kWay, messageOf(scene.surfaces(), known.time));
  }
  tick.finish();
  felt.ticks = ticks;
  return felt;
}

void expectPassive(const Felt& felt) {
  EXPECT_GE(felt.least_J, 0) << "of " << felt.given_J << " J";
  EXPECT_GT(felt.given_J, 0);
  EXPECT_GT(felt.touchedTicks, felt.ticks / 20);
  EXPECT_GT(felt.strongest_N, 0.3);
  std::printf("least %.3g J of %.3g J given, at most %.2f N, %.2f N/ms, touched in %d of %d ticks\n",
              felt.least_J, felt.given_J, felt.strongest_N, felt.steepest_N, felt.touchedTicks, felt.ticks);
}

// In whatever order MuJoCo finds the contacts of a geom: a number does not go from one of its faces to
// another.
TEST(HandInScene, SurfacesKeepTheirNumbers) {
  for (const char* file : {"peg_in_hole.xml", "drawer.xml", "stacked_blocks.xml"}) {
    mujoco_example::HandInScene scene(HAPTICD_EXAMPLES "/mujoco/" + std::string(file));
    std::map<int, std::array<double, 3>> before;
    int known = 0;
    for (int ms = 0; ms < 20'000; ms += 4) {
      // Around the path, so that now this and now that face is the nearest.
      std::array<double, 3> place_m = scene.placeAt(1e-3 * ms);
      place_m[0] += 0.006 * std::sin(0.011 * ms);
      place_m[1] += 0.006 * std::sin(0.007 * ms);
      place_m[2] += 0.006 * std::sin(0.013 * ms);
      scene.setHand(place_m, {});
      scene.step(4e-3);
      std::map<int, std::array<double, 3>> now;
      for (const RemoteContact& surface : scene.surfaces()) {
        const auto& n = surface.normal;
        ASSERT_TRUE(now.emplace(surface.id, n).second) << file << ": a number twice";
        const auto last = before.find(surface.id);
        if (last == before.end()) continue;
        ++known;
        const auto& m = last->second;
        ASSERT_GT(n[0] * m[0] + n[1] * m[1] + n[2] * m[2], 0.5) << file << " at " << ms << " ms";
      }
      before = std::move(now);
    }
    EXPECT_GT(known, 1000) << file;
  }
}

TEST(MujocoLoop, PegInHoleTakesEnergyOnly) {
  const Felt felt = feel("peg_in_hole.xml", reduced(100'000));
  expectPassive(felt);
  // The peg's middle is 16 mm above its end: it touches the walls of the hole, not the top of the block.
  EXPECT_LT(felt.lowest_m, -0.005);
}
TEST(MujocoLoop, DrawerTakesEnergyOnly) {
  const Felt felt = feel("drawer.xml", reduced(100'000));
  expectPassive(felt);
  EXPECT_GT(felt.touchedTicks, 0.4 * felt.ticks) << "the hand opens the drawer and closes it";
}
TEST(MujocoLoop, StackedBlocksTakeEnergyOnly) {
  expectPassive(feel("stacked_blocks.xml", reduced(18'000, 9'000)));
}

}  // namespace
}  // namespace hapticd

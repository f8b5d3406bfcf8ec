// A servo with remote contacts and a client that states them, and random contacts for it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "base/time.h"
#include "realtime/remote/remote_contacts.h"
#include "realtime/remote/remote_input.h"

namespace hapticd::realtime {

inline constexpr Nanos kMs = 1'000'000;
inline constexpr double kRate_N_per_ms = 0.3;  // the most that an update may change a force
inline constexpr double kExact_N = 1e-9;

inline RemoteContact floorAt(double height_m, double stiffness = 800) {
  RemoteContact c;
  c.point_m = {0.02, height_m, -0.01};
  c.normal = Vec3::UnitY();
  c.stiffness_N_per_m = stiffness;
  return c;
}

// A servo of 1 kHz and a client that states whatever the test sets.
struct RemoteRig {
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

}  // namespace hapticd::realtime

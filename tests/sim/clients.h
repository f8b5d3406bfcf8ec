// Who takes part in a simulated run: each kind of client and what it sends.
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "box.h"
#include "sim/sim_client.h"

namespace hapticd::sim {

using geometry::Vec3;
using geometry::Vec3f;

constexpr double kHalf = 20;  // world units (mm) of the cube

inline wire::F64x16 shifted(double x, double y, double z) {
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1};
}

// A client that is missed when it falls silent, and listens to every tick.
class Listener : public SimClient {
 public:
  using SimClient::SimClient;
  bool beats = true;
  bool watched = false;  // it sent a heartbeat: the server knows when they end
  std::uint32_t kinds = wire::kReportDefault | wire::kReportTick;

 protected:
  void onConnected() override {
    queue(wire::Subscribe{kinds, 1000});
    queue(wire::QueryCapabilities{});
    if (beats) queue(wire::Heartbeat{});
    onReady();
    flush();
  }
  virtual void onReady() {}
};

// Owns the cube under the hand.
class CubeOwner final : public Listener {
 public:
  using Listener::Listener;
  std::optional<Nanos> uploaded;

 private:
  void onReady() override {
    std::int32_t number = 0;
    for (const Vec3f& v : test::boxTriples(Vec3f::Constant(kHalf)))
      queue(wire::SetVertex{0, number++, {v.x(), v.y(), v.z()}});
    queue(wire::SetHapticProperty{0, "stiffness", 1.0F});
    uploaded = all_.clock.now();
  }
};

// Has two objects far from the hand that move together only, and one that all batchers move.
class Batcher final : public Listener {
 public:
  Batcher(Clients& all, std::string name, std::int32_t firstObject)
      : Listener(all, std::move(name)), first(firstObject) {
    kinds = wire::kReportButton;
  }
  static constexpr std::int32_t kShared = 9;
  const std::int32_t first;
  std::int64_t sent = 0;

  /// Sends the first of its objects; commit() the second. Much may happen in between.
  void begin() {
    if (open_) commit();
    open_ = true;
    ++sent;
    queue(wire::BatchBegin{});
    send(pose(first));
  }
  void commit() {
    if (!open_ || !connected()) return;
    open_ = false;
    queue(pose(first + 1));
    send(wire::BatchCommit{});
  }
  void batch() {
    begin();
    commit();
  }
  void moveShared() { send(wire::SetTransformMatrix{kShared, shifted(500.0 * first, 0, ++moved_)}); }

 private:
  wire::SetTransformMatrix pose(std::int32_t object) const {
    return {object, shifted(500.0 * first, 0, 10.0 * static_cast<double>(sent))};
  }
  void onReady() override {
    queue(wire::SetObjectNumber{first + 2});
    for (const std::int32_t object : {first, first + 1}) {
      std::int32_t number = 0;
      queue(wire::SetTransformMatrix{object, shifted(500.0 * first, 0, 0)});
      for (const Vec3f& v : test::boxTriples(Vec3f::Constant(5)))
        queue(wire::SetVertex{object, number++, {v.x(), v.y(), v.z()}});
    }
  }

  bool open_ = false;
  int moved_ = 0;
};

// Comes, pushes the hand and goes.
class Pusher final : public Listener {
 public:
  using Listener::Listener;
  std::int32_t effect = 0;
  std::uint64_t seed = 0;
  bool heldForce = false;
  bool gone = false;  // silent, and connected until the server ends that

 private:
  void onReady() override {
    Dice dice(seed);
    heldForce = dice.chance(0.2);
    if (heldForce) {
      queue(wire::HeldForce{.time = 1, .force = {0, 0.3, 0}, .torque = {}, .lifetime = 0.5});
    }
    if (dice.chance(0.2)) queue(wire::ForceField{{}, {0.2F, 0, -0.1F}, {}, 1});
    queue(wire::Effect{.type = "constant",
                       .index = effect,
                       .gain = 0.1,
                       .magnitude = dice.uniform(0.2, 1.0),
                       .duration = 0,
                       .frequency = 50,
                       .position = {10, 0, 0},
                       .direction = {dice.uniform(-1.0, 1.0), 1, 0}});
    queue(wire::StartEffect{effect});
  }
};

// Streams surfaces near the hand, or forces, as a simulation of its own would. They never push down: the
// judge of the cube takes a hand that is not pushed up for a swallowed one.
class Streamer final : public Listener {
 public:
  static constexpr Nanos kLongestLife = 100 * kMs;  // of what was sent

  Streamer(Clients& all, std::string name, std::uint64_t seed)
      : Listener(all, std::move(name)), dice_(seed), contacts_(1 + dice_.below(3)) {
    beats = false;
    kinds = wire::kReportHand;
    forces_ = dice_.chance(0.3);
    stamps_ = dice_.chance(0.7);
    for (Contact& contact : contacts_) contact = draw();
  }
  bool ready = false;
  bool over = false;  // it sends no more

  void next() {
    const Nanos now = all_.clock.now();
    // A set that is older than the newest is ignored.
    const Nanos late = dice_.chance(0.05) ? dice_.between(0, 100 * kMs) : 0;
    const std::int64_t stamp = stamps_ ? 1 + now - late : 0;
    if (forces_) {
      send(wire::HeldForce{.time = stamp,
                           .force = {dice_.uniform(-1.0, 1.0), dice_.uniform(0.0, 1.0), 0},
                           .torque = {},
                           .lifetime = dice_.uniform(0.0, 0.2)});
      return;
    }
    wire::RemoteContacts message{.time = stamp, .stateTime = dice_.chance(0.5) ? now : 0, .contacts = {}};
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      if (dice_.chance(0.05)) continue;  // missing in this set
      // A contact that has passed the hand on its way up would push down.
      constexpr double kRise_m = 0.004;
      const double rise_m = contacts_[i].numbers[13] * base::toSeconds(now - contacts_[i].since);
      if (rise_m > kRise_m || dice_.chance(0.02)) contacts_[i] = draw();  // elsewhere at once
      std::vector<double> numbers = contacts_[i].numbers;
      for (int axis = 0; axis < 3; ++axis)
        numbers[3 + axis] += numbers[12 + axis] * base::toSeconds(now - contacts_[i].since);
      numbers[0] = static_cast<double>(i);
      if (dice_.chance(0.005))
        numbers[dice_.below(numbers.size())] = std::numeric_limits<double>::quiet_NaN();
      message.contacts.values.insert(message.contacts.values.end(), numbers.begin(), numbers.end());
    }
    send(message);
  }

 private:
  struct Contact {
    Nanos since = 0;
    std::vector<double> numbers;
  };
  Contact draw() {
    const auto side = [this](double most) { return dice_.uniform(-most, most); };
    const double turn = side(0.7);
    const double shape = static_cast<double>(dice_.below(3));
    const double radius = dice_.uniform(0.02, 0.1);
    const Vec3 point(side(0.005), dice_.uniform(0.018, 0.03), side(0.005));
    const Vec3 normal(std::sin(turn), std::cos(turn), 0);
    const Vec3 axis(0, 0, 1);
    const Vec3 velocity(side(0.05), side(0.1), side(0.05));
    const Vec3 angularVelocity(side(1), 0, side(1));
    Contact contact{all_.clock.now(), {0, shape, radius}};
    for (const Vec3& v : {point, normal, axis, velocity, angularVelocity})
      contact.numbers.insert(contact.numbers.end(), v.begin(), v.end());
    const double stiffness = dice_.uniform(50, 1500);
    const double damping = dice_.uniform(0, 3);
    const double friction = dice_.uniform(-0.5, 1.5);
    const double lifetime = dice_.uniform(0.02, 0.2);
    const double yields = dice_.chance(0.3) ? 1 : 0;
    for (const double number : {stiffness, damping, friction, 0.8 * friction, lifetime, yields})
      contact.numbers.push_back(number);
    return contact;
  }
  void onReady() override { ready = true; }

  Dice dice_;
  std::vector<Contact> contacts_;
  bool forces_ = false;
  bool stamps_ = true;
};

}  // namespace hapticd::sim

// Commands of clients to the device itself: stop, re-arm, and steering the simulated hand.
#pragma once

#include <optional>
#include <string>

#include "device/simulated/steered_hand.h"
#include "realtime/servo/guard_control.h"
#include "realtime/servo/report.h"
#include "scene/notice.h"
#include "server/session/refusal_codes.h"
#include "wire/messages.h"

namespace hapticd::server {

/// One device. Net thread; every call acts at the next tick.
class DeviceControl {
 public:
  /// `hand` is null for real devices. Both references must outlive this object. Targets are clamped to the
  /// workspace.
  DeviceControl(realtime::GuardControl& guard, device::SteeredHand* hand, const geometry::Box& workspace_m)
      : guard_(guard), hand_(hand), workspace_m_(workspace_m) {}

  /// A stop or a re-arm with its times.
  struct Order {
    base::Nanos received = 0;  ///< when the server read it, on the servo clock
    base::Nanos sent = 0;      ///< its time stamp, on the clock of the machine that sent it
    std::string address;       ///< of that machine
  };
  /// Zero force until a later re-arm.
  void stopForces(const Order& order);
  /// Re-arms. Returns false without effect when a stop is later than the re-arm: it was received at the same
  /// time or later, or the same machine sent it later on another connection.
  bool rearmForces(const Order& order);
  /// Ramps the force in from zero, as after a reset of the scene.
  void rampIn() { guard_.rampIn(); }

  bool canBeHeld() const noexcept { return hand_ != nullptr; }
  /// The client that holds the hand.
  const std::optional<scene::ClientId>& holder() const noexcept { return holder_; }
  /// Sets the hand's target, or releases the hand. Returns false when refused; `refusal` then has code and
  /// text.
  bool hold(scene::ClientId client, const wire::HoldHand& wanted, const realtime::TickReport& last,
            Refusal& refusal);
  void clientGone(scene::ClientId client);

 private:
  void releaseHand();

  realtime::GuardControl& guard_;
  device::SteeredHand* hand_;
  geometry::Box workspace_m_;
  std::optional<scene::ClientId> holder_;
  Order stop_;  // the newest stop
};

}  // namespace hapticd::server

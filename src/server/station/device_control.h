// Stop, re-arm and holding the simulated hand: what clients may do to the device itself.
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

/// One device. Net thread; what it does acts at the next tick.
class DeviceControl {
 public:
  /// `hand` is null for devices that a person moves. Both outlive this. Targets are clamped to the workspace.
  DeviceControl(realtime::GuardControl& guard, device::SteeredHand* hand, const geometry::Box& workspace_m)
      : guard_(guard), hand_(hand), workspace_m_(workspace_m) {}

  /// A stop or a re-arm on its way.
  struct Order {
    base::Nanos received = 0;  ///< when the server read it, on the servo clock
    base::Nanos sent = 0;      ///< its time stamp, on the clock of the machine that sent it
    std::string address;       ///< of that machine
  };
  /// Zero force until a re-arm that was sent later.
  void stopForces(const Order& order);
  /// False, and nothing happens, when a stop came after the re-arm: it was received at the same time or later, or the same
  /// machine sent it later, by another connection.
  bool rearmForces(const Order& order);
  /// After a reset of the scene: what is felt then comes in gently.
  void rampIn() { guard_.rampIn(); }

  bool canBeHeld() const noexcept { return hand_ != nullptr; }
  /// Who holds the hand.
  const std::optional<scene::ClientId>& holder() const noexcept { return holder_; }
  /// Moves the hand's target, or lets go. False when refused; `refusal` then has code and text.
  bool hold(scene::ClientId client, const wire::HoldHand& wanted, const realtime::TickReport& last,
            Refusal& refusal);
  void clientGone(scene::ClientId client);

 private:
  void letGo();

  realtime::GuardControl& guard_;
  device::SteeredHand* hand_;
  geometry::Box workspace_m_;
  std::optional<scene::ClientId> holder_;
  Order stop_;  // the last one
};

}  // namespace hapticd::server

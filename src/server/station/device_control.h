// Stop, re-arm and holding the simulated hand: what clients may do to the device itself.
#pragma once

#include <algorithm>
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

  /// Zero force until a re-arm that was received later than this.
  void stopForces(base::Nanos received) {
    stopped_ = std::max(stopped_, received);
    guard_.stop();
  }
  /// False, and nothing happens, when a stop was received at the same time or later: the re-arm was sent without
  /// knowing of it.
  bool rearmForces(base::Nanos received) {
    if (received <= stopped_) return false;
    guard_.rearm();
    return true;
  }
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
  base::Nanos stopped_ = 0;  // when the last stop was received
};

}  // namespace hapticd::server

// Commands of clients to the device itself: stop, re-arm, and steering the simulated hand.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "device/simulated/steered_hand.h"
#include "realtime/servo/guard_control.h"
#include "scene/notice.h"
#include "server/session/refusal_codes.h"
#include "wire/messages.h"

namespace hapticd::server {

/// One device. Net thread; every call acts at the next tick.
class DeviceControl {
 public:
  /// `hand` is null for devices whose hand nobody steers: real ones and recorded ones. Both references must
  /// outlive this object. Targets are clamped to the workspace.
  DeviceControl(realtime::GuardControl& guard, device::SteeredHand* hand, const geometry::Box& workspace_m,
                bool isReal = true)
      : guard_(guard), hand_(hand), workspace_m_(workspace_m), isReal_(isReal) {}

  /// A stop or a re-arm with its times.
  struct Order {
    base::Nanos received = 0;  ///< when the server read it, on the servo clock
    base::Nanos sent = 0;      ///< its time stamp, on the clock of the machine that sent it
    std::string address;       ///< of that machine
    scene::ClientId client = 0;
  };
  static constexpr base::Nanos kLongestTravel = 10'000'000'000;

  /// The client that stops, re-arms or holds.
  struct Sender {
    scene::ClientId client = 0;
    std::uint64_t key = 0;      ///< that the connections of one program share; 0: none
    std::string description;    ///< for texts
    bool mayCommand = false;    ///< an owner in control, or an operator
    bool isOperator = false;    ///< proven by a token or a user id
    bool isPage = false;        ///< a page in a browser
    bool hasOperators = false;  ///< the server knows somebody who could prove to be one
    bool hasSocket = false;     ///< its user can prove it by the server's Unix socket
  };
  /// Zero force until a later re-arm. Any client may.
  void stopForces(const Order& order, const Sender& sender);
  /// Re-arms. Returns false, with the reason, when
  /// - a stop is later than the re-arm, also one that no client sent (a signal, a suspension): it was
  /// received at the same time or later, or the same machine sent
  ///   it later on another connection (a stamp that is earlier by more than kLongestTravel proves nothing:
  ///   the clock of that machine was set);
  /// - a stop of another program stands. Each program may undo its own; operators undo all; where there are
  ///   none, a page in a browser does, once all connections of those programs are gone;
  /// - the sender may not command, and there is more to re-arm than its own stop (`faults`: latched trips, or
  /// a stop that no client sent).
  bool rearmForces(const Order& order, const Sender& sender, bool faults, Refusal& refusal);

  bool canBeHeld() const noexcept { return hand_ != nullptr; }
  /// The client that holds the hand.
  const std::optional<scene::ClientId>& holder() const noexcept { return holder_; }
  /// Sets the hand's target, a pose in the world, or releases the hand. Returns false when refused; `refusal`
  /// then has code and text.
  bool hold(scene::ClientId client, const wire::HoldHand& wanted, const geometry::Affine& T_world_device,
            Refusal& refusal);
  /// Releases the hand if the client holds it.
  void letGo(scene::ClientId client);
  void clientGone(scene::ClientId client);
  /// The client belongs to the program with this key.
  void setKey(scene::ClientId client, std::uint64_t key) { keys_[client] = key; }

 private:
  // A stop that stands. The program is its key or, without one, its connection.
  struct Stop {
    std::uint64_t key = 0;
    std::vector<scene::ClientId> clients;  // connections of the program that stopped and are open
    std::string description;
    bool isOf(const Sender& sender) const noexcept;
  };

  void releaseHand();
  bool isGone(const Stop& stop) const;

  realtime::GuardControl& guard_;
  device::SteeredHand* hand_;
  geometry::Box workspace_m_;
  bool isReal_;
  std::optional<scene::ClientId> holder_;
  Order stop_;                                     // the newest stop
  std::vector<Stop> stops_;                        // oldest first
  std::map<scene::ClientId, std::uint64_t> keys_;  // of the open connections that have one
  // What guard_.stops() counted at the last re-arm, and how many stops of clients came since.
  std::uint32_t stopsBefore_ = guard_.stops();
  std::uint32_t stopsOfClients_ = 0;
};

}  // namespace hapticd::server

// What clients stream to a servo: contacts near the hand and a held force. Plain values in the device frame,
// SI, already within their limits; docs/remote-contacts.md states the laws.
#pragma once

#include <array>
#include <cstdint>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::realtime {

using base::Nanos;
using geometry::Vec3;

inline constexpr std::size_t kMaxRemoteContacts = 16;
inline constexpr Nanos kLongestRemoteLife = 100'000'000;
inline constexpr double kRemoteSpeed_m_per_s = 1;    ///< of a surface, stated or corrected
inline constexpr double kRemoteRate_N_per_s = 300;   ///< by which an update may change the force
inline constexpr double kRemoteTurn_rad_per_s = 20;  ///< of a surface

enum class RemoteShape : std::uint8_t { halfSpace, sphere, cylinder };

/// A surface at one point, as the client stated it at RemoteContactSet::stated.
struct RemoteContact {
  std::int32_t id = 0;
  RemoteShape shape = RemoteShape::halfSpace;
  bool yields =
      false;  ///< follows the hand: its corrections are free, its stiffness bound has the client's delay
  double radius_m = 0;  ///< of a sphere or cylinder; negative: touched from inside
  Vec3 point_m = Vec3::Zero();
  Vec3 normal = Vec3::UnitY();           ///< unit, out of the material
  Vec3 axis = Vec3::UnitZ();             ///< unit, of a cylinder
  Vec3 velocity_m_per_s = Vec3::Zero();  ///< of the surface at the point
  Vec3 angularVelocity_rad_per_s = Vec3::Zero();
  double stiffness_N_per_m = 0;  ///< above 0
  double damping_Ns_per_m = 0;
  double staticFriction = 0;
  double dynamicFriction = 0;  ///< at most the static one
  Nanos lifetime = kLongestRemoteLife;
};

/// The newest contacts of the one client that streams them.
struct RemoteContactSet {
  std::uint64_t number = 0;     ///< counts sets; a tick takes each number once
  std::int64_t clientTime = 0;  ///< the client's stamp
  Nanos received = 0;           ///< servo clock; lifetimes count from here
  Nanos stated = 0;             ///< servo clock; the surfaces move on from here
  std::uint32_t count = 0;
  std::array<RemoteContact, kMaxRemoteContacts> contacts;
};

/// Energy that a held force may give to the hand beyond what the hand returned.
struct EnergyBudget {
  double start_J = 0.020;
  double capacity_J = 0.050;
  double refill_W = 0.020;
};

/// A force that a client wants held.
struct HeldForce {
  std::uint64_t number = 0;
  std::int64_t clientTime = 0;
  Nanos received = 0;
  Nanos lifetime = 0;
  Vec3 force_N = Vec3::Zero();
  EnergyBudget budget;
};

/// From the net thread to the servo: the newest value wins.
struct RemoteInput {
  RemoteContactSet contacts;
  HeldForce force;
};

}  // namespace hapticd::realtime

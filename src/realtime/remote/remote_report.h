// What a tick made of the streamed input.
#pragma once

#include <algorithm>

#include "realtime/remote/remote_input.h"

namespace hapticd::realtime {

/// One remote contact that exerts force. Single precision keeps the ring of reports small.
struct RemoteContactReport {
  std::int32_t id = 0;
  geometry::Vec3f proxy_m = geometry::Vec3f::Zero();  ///< on the surface as rendered
  geometry::Vec3f force_N = geometry::Vec3f::Zero();  ///< on the hand
  float depth_m = 0;
};

enum RemoteStatus : std::uint32_t {
  kRemoteEnergySpent = 1U << 0,      ///< the part of the held force that adds power is cut
  kRemoteCorrectionsHeld = 1U << 1,  ///< a surface moved without a stated velocity and waits for energy
};

/// Device frame. A copy takes the first `count` contacts only.
struct RemoteRendering {
  Vec3 contactForce_N = Vec3::Zero();  ///< what all remote contacts add to the scene, before the guard
  Vec3 heldForce_N = Vec3::Zero();     ///< before the guard
  /// Left for the held force; as long as nothing was streamed, what its tank starts with.
  double energy_J = EnergyBudget{}.start_J;
  std::int64_t contactsTime = 0;  ///< the client's stamp of the newest set that this tick knows
  std::int64_t forceTime = 0;     ///< the same of the held force
  std::uint32_t status = 0;       ///< RemoteStatus bits
  std::uint32_t count = 0;
  std::array<RemoteContactReport, kMaxRemoteContacts> contacts;

  RemoteRendering() = default;
  RemoteRendering(const RemoteRendering& other) noexcept { *this = other; }
  RemoteRendering& operator=(const RemoteRendering& other) noexcept {
    contactForce_N = other.contactForce_N;
    heldForce_N = other.heldForce_N;
    energy_J = other.energy_J;
    contactsTime = other.contactsTime;
    forceTime = other.forceTime;
    status = other.status;
    count = other.count;
    std::copy_n(other.contacts.begin(), count, contacts.begin());
    return *this;
  }
};

}  // namespace hapticd::realtime

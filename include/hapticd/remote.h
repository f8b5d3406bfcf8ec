// Contacts that a client's own simulation streams to the server; see Client::setRemoteContacts().
#pragma once

#include <array>
#include <chrono>

namespace hapticd {

enum class RemoteShape { halfSpace = 0, sphere = 1, cylinder = 2 };

/// One surface near the tool, as the client's simulation knows it now. World frame; lengths as in the reports
/// (world units / 1000: metres when the world is in millimetres).
struct RemoteContact {
  int id = 0;  ///< the same surface keeps its number from update to update, and moves without a step
  RemoteShape shape = RemoteShape::halfSpace;
  std::array<double, 3> point_m{};           ///< on the surface
  std::array<double, 3> normal{0, 1, 0};     ///< of any length, out of the material
  double radius_m = 0;                       ///< of a sphere or cylinder; negative: touched from inside
  std::array<double, 3> axis{0, 0, 1};       ///< of a cylinder, across the normal
  std::array<double, 3> velocity_m_per_s{};  ///< of the surface at the point, at most 1 m/s of the device
  std::array<double, 3> angularVelocity_rad_per_s{};  ///< at most 20 rad/s
  double stiffness_N_per_m = 500;  ///< of the device's metres; the server lowers it to what its loop can bear
  double damping_Ns_per_m = 0;
  double staticFriction = 0;   ///< Coulomb coefficient, at most 1
  double dynamicFriction = 0;  ///< at most the static one
  std::chrono::nanoseconds lifetime =
      std::chrono::milliseconds(100);  ///< 10 to 100 ms, with the fade at its end
  /// The surface follows the hand, as a simulated object that the hand pushes: its position may change at any
  /// rate, and the client's round trip lowers the stiffness that the server allows. Otherwise it moves by its
  /// stated velocity, at full stiffness, and other changes are paid from a small budget of energy.
  bool yields = false;
};

}  // namespace hapticd

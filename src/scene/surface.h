// What an object feels like: the surface (haptic material) in SI.
#pragma once

namespace hapticd::scene {

/// Surface of one object, in SI. All zero until a client sets it: an object exerts force once it has
/// stiffness.
struct Surface {
  double stiffness_N_per_m = 0;
  double damping_Ns_per_m = 0;
  double staticFriction = 0;   ///< Coulomb coefficient while sticking
  double dynamicFriction = 0;  ///< Coulomb coefficient while sliding, at most the static one
  double popthrough_N = 0;     ///< normal spring force that lets the proxy through; 0 is off
  double mass_kg = 0;

  friend bool operator==(const Surface&, const Surface&) = default;
};

/// Which side of a face can be touched; the front sees its corners counter-clockwise.
enum class TouchableFaces { front, back, both };

}  // namespace hapticd::scene

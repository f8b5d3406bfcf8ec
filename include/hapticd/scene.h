// What a client puts into the scene, as plain values.
//
// Lengths are units of the client's world, in the world frame, where nothing else is said; without a
// workspace command, one unit is 1 mm of the device. Types of stock VRPN (ForceField, Plane, PlaneTexture)
// are in metres instead. Servers check the values: a value out of range is clamped, an invalid one refused,
// each with a text (Client::onText()).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "hapticd/export.h"

namespace hapticd {

using Vec3 = std::array<double, 3>;
/// Column-major as in OpenGL: the translation is in elements 12, 13 and 14.
using Matrix4 = std::array<double, 16>;

inline constexpr Matrix4 kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
/// The matrix that translates by (x, y, z).
constexpr Matrix4 translation(double x, double y, double z) {
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1};
}

/// Haptic properties of an object's surface. All but the mass range from 0 to 1; docs/haptics.md gives their
/// units and laws, of which `material_scale` in the server's configuration selects one of two.
struct Surface {
  float stiffness = 0.5F;     ///< 1: 500 N/m, or the device's nominal stiffness; 0 cannot be felt
  float damping = 0;          ///< 1: 2 N s/m
  float staticFriction = 0;   ///< Coulomb coefficient
  float dynamicFriction = 0;  ///< Coulomb coefficient, at most the static one
  float popthrough = 0;  ///< force at which the surface gives way, 1: 3.3 N or the device's peak; 0: never
  float mass_kg = 0;     ///< stored by the server and not rendered
};

/// Axis-aligned box, world units.
struct Box {
  Vec3 min{};
  Vec3 max{};
};

/// Triangles of a mesh in memory of the caller; counter-clockwise seen from the front.
struct MeshView {
  std::span<const std::array<float, 3>> vertices;           ///< object units, object frame
  std::span<const std::array<std::uint32_t, 3>> triangles;  ///< indices into vertices, from 0
};

/// Sides of triangles that are rendered.
enum class Faces { front = 0, back = 1, both = 2 };

/// How a button reports; the numbers are VRPN's.
enum class ButtonMode { momentary = 10, toggleStartsOff = 20, toggleStartsOn = 21 };

/// Law of an effect.
enum class EffectType {
  constant,          ///< a constant force
  spring,            ///< a pull to a position, proportional to the distance
  viscous,           ///< a force against the velocity, proportional to the speed
  friction,          ///< dry friction in free space
  motorVibration,    ///< a vibration of the device, in contact or not
  contactVibration,  ///< a vibration along the surface normal, in contact only
};
/// The name on the wire: "constant", "spring", "viscous", "friction", "vibrationMotor" or "vibrationContact".
constexpr std::string_view nameOf(EffectType type) noexcept {
  constexpr std::string_view kNames[] = {"constant", "spring",         "viscous",
                                         "friction", "vibrationMotor", "vibrationContact"};
  return kNames[static_cast<std::size_t>(type)];
}

/// A force that belongs to no object. The type decides which fields count: use the functions below.
struct Effect {
  EffectType type = EffectType::constant;
  double gain = 0;         ///< spring, friction: N/mm; viscous: N per mm/s; millimetres of the device
  double magnitude_N = 0;  ///< the force, or its upper limit
  double duration_ms = 0;  ///< 0: until stopped
  /// motorVibration: Hz. contactVibration: rad/s, or Hz if the server's `vibration_contact_unit` says so.
  double frequency = 0;
  Vec3 position{};   ///< spring: world units, world frame
  Vec3 direction{};  ///< constant: world frame, of any length

  /// A force of this magnitude in this direction.
  static Effect constant(const Vec3& direction, double magnitude_N, double duration_ms = 0) {
    return {EffectType::constant, 0, magnitude_N, duration_ms, 0, {}, direction};
  }
  /// A pull to the position that grows with the distance up to the magnitude.
  static Effect spring(const Vec3& position, double gain_N_per_mm, double magnitude_N,
                       double duration_ms = 0) {
    return {EffectType::spring, gain_N_per_mm, magnitude_N, duration_ms, 0, position, {}};
  }
  /// A force against the motion that grows with the speed up to the magnitude.
  static Effect viscous(double gain_N_s_per_mm, double magnitude_N, double duration_ms = 0) {
    return {EffectType::viscous, gain_N_s_per_mm, magnitude_N, duration_ms, 0, {}, {}};
  }
  /// Dry friction in free space: sticks up to the magnitude, then slips.
  static Effect friction(double gain_N_per_mm, double magnitude_N, double duration_ms = 0) {
    return {EffectType::friction, gain_N_per_mm, magnitude_N, duration_ms, 0, {}, {}};
  }
  /// A vibration of the device until it is stopped.
  static Effect motorVibration(double frequency_Hz, double magnitude_N) {
    return {EffectType::motorVibration, 0, magnitude_N, 0, frequency_Hz, {}, {}};
  }
  /// A vibration along the surface normal while something is touched, until it is stopped. The unit of the
  /// frequency is that of Effect::frequency.
  static Effect contactVibration(double frequency_rad_per_s, double magnitude_N) {
    return {EffectType::contactVibration, 0, magnitude_N, 0, frequency_rad_per_s, {}, {}};
  }
};

/// A force that varies linearly with the position within a radius. Stock VRPN, metres.
struct ForceField {
  std::array<float, 3> origin_m{};
  std::array<float, 3> force_N{};           ///< at the origin
  std::array<float, 9> jacobian_N_per_m{};  ///< dF_i/dx_j, row by row
  float radius_m = 0;                       ///< no force beyond it
};

/// A half-space that is solid where a x + b y + c z + d < 0, and its surface. Stock VRPN, metres.
struct Plane {
  std::array<float, 4> plane{0, 1, 0,
                             0};  ///< a, b, c, d; the normal (a, b, c) of any length, d in metres times it
  float stiffness = 0.5F;         ///< in 1000 N/m
  float damping = 0;              ///< in 1000 N s/m, at most 0.005
  float staticFriction = 0;       ///< Coulomb coefficient
  float dynamicFriction = 0;      ///< Coulomb coefficient
  int index = 0;                  ///< 0 to 7
  /// Time over which a new placement of the plane moves in under the hand: 1 to 10 000 ms. VRPN calls these
  /// recovery cycles; a cycle is a millisecond, whatever the servo rate.
  int recovery_ms = 10;
};

/// Adhesion, texture and buzz of plane 0. Stock VRPN, metres.
struct PlaneTexture {
  float normalAdhesion_N = 0;         ///< force up to which the plane pulls back a hand that leaves
  float lateralAdhesion_N = 0;        ///< tangential force that the plane holds besides friction
  float textureAmplitude_m = 0;       ///< height of waves around the first contact
  float textureWavelength_m = 0.01F;  ///< 0: no texture
  float buzzAmplitude_m = 0;          ///< height by which the plane vibrates
  float buzzFrequency_Hz = 60;
};

}  // namespace hapticd

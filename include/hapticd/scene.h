// What a client can put into the scene, as plain values.
//
// Lengths are units of the client's world; without a workspace one unit is 1 mm of the device. The stock
// calls (see Client) are in metres instead.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace hapticd {

using Vec3 = std::array<double, 3>;
using Matrix4 =
    std::array<double, 16>;  ///< column-major as OpenGL has it: the translation is in 12, 13 and 14

inline constexpr Matrix4 kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
/// A matrix that moves by (x, y, z).
constexpr Matrix4 translation(double x, double y, double z) {
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1};
}

/// What an object feels like: all but the mass from 0 to 1, servers clamp the rest and say so.
struct Surface {
  float stiffness = 0.5F;  ///< of the server's reference stiffness; 0 cannot be felt
  float damping = 0;
  float static_friction = 0;   ///< Coulomb coefficient
  float dynamic_friction = 0;  ///< Coulomb coefficient, at most the static one
  float popthrough = 0;        ///< share of the device's force at which the surface gives way; 0: never
  float mass_kg = 0;
};

/// An axis-aligned box, world units.
struct Box {
  Vec3 min{};
  Vec3 max{};
};

/// Triangles of a mesh in somebody else's memory; counter-clockwise as seen from the front.
struct MeshView {
  std::span<const std::array<float, 3>> vertices;  ///< object units
  std::span<const std::array<std::uint32_t, 3>> triangles;
};

/// Which sides of triangles are felt.
enum class Faces { front = 0, back = 1, both = 2 };

/// How a button reports.
enum class ButtonMode { momentary = 10, toggleStartsOff = 20, toggleStartsOn = 21 };

/// A force that belongs to no object. Which fields matter depends on the type: use the makers below.
struct Effect {
  std::string_view type;   ///< name on the wire
  double gain = 0;         ///< spring, friction: N/mm; viscous: N/(mm/s)
  double magnitude_N = 0;  ///< the force, or its limit
  double duration_ms = 0;  ///< ends by itself after this long; 0: until stopped
  double frequency = 0;    ///< vibrations
  Vec3 position{};         ///< world units
  Vec3 direction{};        ///< of any length

  /// A force of this size in this direction.
  static Effect constant(const Vec3& direction, double magnitude_N, double duration_ms = 0) {
    return {"constant", 0, magnitude_N, duration_ms, 0, {}, direction};
  }
  /// A pull to the position that grows with the distance up to the magnitude.
  static Effect spring(const Vec3& position, double gain_N_per_mm, double magnitude_N,
                       double duration_ms = 0) {
    return {"spring", gain_N_per_mm, magnitude_N, duration_ms, 0, position, {}};
  }
  /// A force against the motion that grows with the speed up to the magnitude.
  static Effect viscous(double gain_N_s_per_mm, double magnitude_N, double duration_ms = 0) {
    return {"viscous", gain_N_s_per_mm, magnitude_N, duration_ms, 0, {}, {}};
  }
  /// Dry friction in free space: holds up to the magnitude, then slides.
  static Effect friction(double gain_N_per_mm, double magnitude_N, double duration_ms = 0) {
    return {"friction", gain_N_per_mm, magnitude_N, duration_ms, 0, {}, {}};
  }
  /// A vibration of the device, always felt while it runs.
  static Effect motorVibration(double frequency_Hz, double magnitude_N) {
    return {"vibrationMotor", 0, magnitude_N, 0, frequency_Hz, {}, {}};
  }
  /// A vibration along the surface normal, felt while something is touched; in rad/s as servers have it.
  static Effect contactVibration(double frequency_rad_per_s, double magnitude_N) {
    return {"vibrationContact", 0, magnitude_N, 0, frequency_rad_per_s, {}, {}};
  }
};

/// A force that varies linearly around an origin within a radius; stock VRPN, in metres.
struct ForceField {
  std::array<float, 3> origin_m{};
  std::array<float, 3> force_N{};           ///< at the origin
  std::array<float, 9> jacobian_N_per_m{};  ///< dF_i/dx_j, row by row
  float radius_m = 0;                       ///< no force beyond it
};

/// A plane a x + b y + c z + d = 0 to touch and its surface; stock VRPN, in metres.
struct Plane {
  std::array<float, 4> plane{0, 1, 0, 0};
  float stiffness = 0.5F;  ///< 1: 1000 N/m
  float damping = 0;       ///< 0.005: 5 N s/m
  float static_friction = 0;
  float dynamic_friction = 0;
  std::int32_t index = 0;
  std::int32_t recovery_cycles = 10;  ///< servo ticks over which a changed plane is blended in
};

/// Adhesion, texture and buzz of the plane; stock VRPN.
struct PlaneTexture {
  float normal_adhesion = 0;
  float lateral_adhesion = 0;
  float texture_amplitude = 0;
  float texture_wavelength = 0.01F;
  float buzz_amplitude = 0;
  float buzz_frequency_Hz = 60;
};

}  // namespace hapticd

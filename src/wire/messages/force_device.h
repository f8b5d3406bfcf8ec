// Messages of vrpn_ForceDevice that every VRPN has, first part: what a device reports, and what the driver
// of a device renders itself (planes, force fields, constraints, custom effects). No alignment: a double may
// sit at any offset.
#pragma once

#include "wire/types.h"

namespace hapticd::wire {

/// CustomEffect::effect that stops the running one.
inline constexpr std::uint32_t kStopCustomEffect = 0xFFFFFFFF;

struct Force {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice Force", Direction::kToClient, Reliability::kLowLatency,
                                     Role::report, "Reports the force at the device."};
  F64x3 force{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("force", m.force, "N");
  }
};

struct Scp {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice SCP", Direction::kToClient, Reliability::kLowLatency, Role::report,
      "Reports the surface contact point: where the proxy rests, and the stylus orientation."};
  F64x3 position{};
  F64x4 orientation{0, 0, 0, 1};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("position", m.position, "m");
    v("orientation", m.orientation);
  }
};

struct ForceError {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice Force_Error", Direction::kToClient, Reliability::kReliable, Role::report,
      "Reports a fault: 0 value out of range, 1 duty cycle, 2 force or motor, 3 other, 4 recovered."};
  std::int32_t code = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("code", m.code);
  }
};

struct ForceField {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice Force_Field", Direction::kToServer,
                                     Reliability::kLowLatency, Role::scene,
                                     "Sets a force that varies linearly with the distance from an origin "
                                     "inside a sphere; all zero (sent reliably) stops it."};
  F32x3 origin{};
  F32x3 force{};
  std::array<float, 9> jacobian{};
  float radius = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("origin", m.origin, "m");
    v("force", m.force, "N");
    v("jacobian", m.jacobian, "N/m");
    v("radius", m.radius, "m");
  }
};

struct Plane {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice Plane", Direction::kToServer, Reliability::kLowLatency, Role::scene,
      "Sets a plane a x + b y + c z + d = 0 to touch; starting and stopping it is sent reliably."};
  std::array<float, 4> plane{};
  float stiffness = 0;
  float damping = 0;
  float dynamicFriction = 0;
  float staticFriction = 0;
  std::int32_t index = 0;
  std::int32_t recoveryCycles = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("plane", m.plane);
    v("stiffness", m.stiffness);
    v("damping", m.damping);
    v("dynamic_friction", m.dynamicFriction);
    v("static_friction", m.staticFriction);
    v("index", m.index);
    v("recovery_cycles", m.recoveryCycles);
  }
};

struct Plane2 {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice Plane2", Direction::kToServer,
                                     Reliability::kLowLatency, Role::scene,
                                     "Sets the texture, the buzz and the adhesion of the plane."};
  float normalAdhesion = 0;
  float lateralAdhesion = 0;
  float textureAmplitude = 0;
  float textureWavelength = 0;
  float buzzAmplitude = 0;
  float buzzFrequency = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("normal_adhesion", m.normalAdhesion);
    v("lateral_adhesion", m.lateralAdhesion);
    v("texture_amplitude", m.textureAmplitude);
    v("texture_wavelength", m.textureWavelength);
    v("buzz_amplitude", m.buzzAmplitude);
    v("buzz_frequency", m.buzzFrequency, "Hz");
  }
};

struct CustomEffect {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice Custom Effect", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Starts an effect that the device driver defines by number; 0xFFFFFFFF stops it."};
  std::uint32_t effect = 0;
  Counted<std::uint32_t, float, 15998> parameters;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("effect", m.effect);
    v("parameters", m.parameters);
  }
};

// Registered by both sides; the stock client turns constraints into Force_Field and sends only some of these.

struct ConstraintEnable {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice constraint_enable", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Switches the constraint on (1) or off (0)."};
  std::int32_t enable = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("enable", m.enable);
  }
};

struct ConstraintMode {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice constraint_mode", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Chooses the constraint: 0 none, 1 point, 2 line, 3 plane."};
  std::int32_t mode = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("mode", m.mode);
  }
};

struct ConstraintPoint {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice constraint_point", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Sets the point of a point constraint."};
  F32x3 point{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("point", m.point, "m");
  }
};

struct ConstraintLinePoint {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice constraint_linept", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Sets a point of the line of a line constraint."};
  F32x3 point{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("point", m.point, "m");
  }
};

struct ConstraintLineDirection {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice constraint_linedir", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Sets the direction of the line of a line constraint."};
  F32x3 direction{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("direction", m.direction);
  }
};

struct ConstraintPlanePoint {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice constraint_plpt", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Sets a point of the plane of a plane constraint."};
  F32x3 point{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("point", m.point, "m");
  }
};

struct ConstraintPlaneNormal {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice constraint_plnorm", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Sets the normal of the plane of a plane constraint."};
  F32x3 normal{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("normal", m.normal);
  }
};

struct ConstraintStiffness {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice constraint_KSpring", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Sets the spring that holds the constraint."};
  float stiffness = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("stiffness", m.stiffness, "N/m");
  }
};

}  // namespace hapticd::wire

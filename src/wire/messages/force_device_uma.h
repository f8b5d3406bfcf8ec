// Messages of vrpn_ForceDevice added by the University of Malaga's server for haptic devices (VRPN pull
// request 110).
#pragma once

#include "wire/types.h"

namespace hapticd::wire {

struct SetWorkspaceBoundingBox {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setWorkspaceBoundingBox", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Fits the device workspace to a box (min x y z, max x y z) seen through "
                                     "a model matrix (column-major)."};
  F64x16 model{};
  std::array<double, 6> box{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("model", m.model);
    v("box", m.box, "world units");
  }
};

struct SetWorkspaceProjectionMatrix {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice setWorkspaceProjectionMatrix", Direction::kToServer, Reliability::kReliable,
      Role::scene,
      "Fits the device workspace to a view volume, by a model and a projection matrix (column-major)."};
  F64x16 model{};
  F64x16 projection{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("model", m.model);
    v("projection", m.projection);
  }
};

struct SetObjectNumber {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setObjectNumber", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Makes the scene have at least this many objects, numbered from 0."};
  std::int32_t count = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("count", m.count);
  }
};

struct SetTransformMatrix {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice setTransformMatrix", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Sets the pose and scale of an object: a column-major matrix, translation in elements 12 to 14."};
  std::int32_t object = 0;
  F64x16 matrix{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("matrix", m.matrix);
  }
};

struct SetHapticProperty {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setHapticProperty", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Sets one property of an object's surface: stiffness, damping, static "
                                     "friction, dynamic friction, popthrough or mass."};
  std::int32_t object = 0;
  NameBuffer<20> property;
  float value = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("property", m.property);
    v("value", m.value);
  }
};

struct SetTouchableFace {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice setTouchableFace", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Chooses the faces that are rendered: 0 front, 1 back, any other value both."};
  std::int32_t face = 2;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("face", m.face);
  }
};

struct Effect {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice Effect", Direction::kToServer,
                                     Reliability::kLowLatency, Role::scene,
                                     "Defines an effect by index: constant, spring, viscous, friction, "
                                     "vibrationMotor or vibrationContact; duration 0 lasts until stopped."};
  NameBuffer<20> type;
  std::int32_t index = 0;
  double gain = 0;
  double magnitude = 0;
  double duration = 0;
  double frequency = 0;
  F64x3 position{};
  F64x3 direction{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("type", m.type);
    v("index", m.index);
    v("gain", m.gain);
    v("magnitude", m.magnitude, "N");
    v("duration", m.duration, "ms");
    v("frequency", m.frequency);
    v("position", m.position, "world units");
    v("direction", m.direction);
  }
};

struct StartEffect {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice startEffect", Direction::kToServer,
                                     Reliability::kReliable, Role::scene, "Starts an effect."};
  std::int32_t index = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("index", m.index);
  }
};

struct StopEffect {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice stopEffect", Direction::kToServer,
                                     Reliability::kReliable, Role::scene, "Stops an effect."};
  std::int32_t index = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("index", m.index);
  }
};

struct ResetScene {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice resetScene", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Resets workspace, objects and effects to their initial state; the byte has no meaning."};
  std::uint8_t ignored = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("ignored", m.ignored);
  }
};

struct Dop {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice DOP", Direction::kToClient, Reliability::kLowLatency,
                                     Role::report, "Reports the depth of penetration."};
  double depth = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("depth", m.depth, "m");
  }
};

struct IsTouching {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice isTouching", Direction::kToClient,
                                     Reliability::kLowLatency, Role::report,
                                     "Reports whether anything is touched."};
  Bool16 touching = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("touching", m.touching);
  }
};

struct TouchedObject {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice TouchedObject", Direction::kToClient,
                                     Reliability::kLowLatency, Role::report,
                                     "Reports which object is touched, -1 for none."};
  std::int32_t object = -1;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
  }
};

struct Angle {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice Angle", Direction::kToClient, Reliability::kLowLatency, Role::report,
      "Reports the angle between stylus and surface normal, 0 without contact."};
  double angle = 0;
  Bool16 touching = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("angle", m.angle, "deg");
    v("touching", m.touching);
  }
};

}  // namespace hapticd::wire

// Messages of vrpn_ForceDevice that every VRPN has, second part: the scene that a client builds. A call of
// the C++ client that names no object addresses object 0.
#pragma once

#include "wire/types.h"

namespace hapticd::wire {

struct AddObject {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice addObject", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Adds an object below a parent (-1: the scene)."};
  std::int32_t object = 0;
  std::int32_t parent = -1;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("parent", m.parent);
  }
};

struct AddObjectExScene {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice addObjectExScene", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Adds an object beside the scene, as another root."};
  std::int32_t object = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
  }
};

struct MoveToParent {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice moveToParent", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Moves an object below another parent."};
  std::int32_t object = 0;
  std::int32_t parent = -1;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("parent", m.parent);
  }
};

struct SetObjectPosition {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setObjectPosition", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Places an object relative to its parent."};
  std::int32_t object = 0;
  F32x3 position{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("position", m.position, "m");
  }
};

struct SetObjectOrientation {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setObjectOrientation", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Turns an object relative to its parent, about an axis."};
  std::int32_t object = 0;
  F32x3 axis{};
  float angle = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("axis", m.axis);
    v("angle", m.angle, "rad");
  }
};

struct SetObjectScale {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setObjectScale", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Scales an object along its own axes."};
  std::int32_t object = 0;
  F32x3 scale{1, 1, 1};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("scale", m.scale);
  }
};

struct RemoveObject {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice removeObject", Direction::kToServer,
                                     Reliability::kReliable, Role::scene, "Removes an object."};
  std::int32_t object = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
  }
};

struct SetVertex {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice setVertex", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Sets a vertex of an object's mesh; without triangles, consecutive triples are faces."};
  std::int32_t object = 0;
  std::int32_t vertex = 0;
  F32x3 position{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("vertex", m.vertex);
    v("position", m.position, "object units");
  }
};

struct SetNormal {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setNormal", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Sets a vertex normal of an object's mesh."};
  std::int32_t object = 0;
  std::int32_t normal = 0;
  F32x3 direction{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("normal", m.normal);
    v("direction", m.direction);
  }
};

struct SetTriangle {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice setTriangle", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Sets a triangle of an object's mesh by vertex and normal numbers (normals -1: none)."};
  std::int32_t object = 0;
  std::int32_t triangle = 0;
  std::array<std::int32_t, 3> vertices{};
  std::array<std::int32_t, 3> normals{-1, -1, -1};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("triangle", m.triangle);
    v("vertices", m.vertices);
    v("normals", m.normals);
  }
};

struct RemoveTriangle {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice removeTriangle", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Removes a triangle of an object's mesh."};
  std::int32_t object = 0;
  std::int32_t triangle = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("triangle", m.triangle);
  }
};

struct UpdateTrimeshChanges {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice updateTrimeshChanges", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Makes mesh edits effective, with this surface."};
  std::int32_t object = 0;
  float stiffness = 0;
  float damping = 0;
  float staticFriction = 0;
  float dynamicFriction = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("stiffness", m.stiffness);
    v("damping", m.damping);
    v("static_friction", m.staticFriction);
    v("dynamic_friction", m.dynamicFriction);
  }
};

struct TransformTrimesh {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice transformTrimesh", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Moves the vertices of an object's mesh by a row-major 4x4 matrix."};
  std::int32_t object = 0;
  std::array<float, 16> matrix{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("matrix", m.matrix);
  }
};

struct SetTrimeshType {
  static constexpr MessageInfo kInfo{
      "vrpn_ForceDevice setTrimeshType", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Chooses a rendering library: 0 Ghost, 1 Hcollide; object -1 means all."};
  std::int32_t object = 0;
  std::int32_t type = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("type", m.type);
  }
};

struct ClearTrimesh {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice clearTrimesh", Direction::kToServer,
                                     Reliability::kReliable, Role::scene, "Removes an object's mesh."};
  std::int32_t object = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
  }
};

struct SetHapticOrigin {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setHapticOrigin", Direction::kToServer,
                                     Reliability::kReliable, Role::scene, "Places the device in the scene."};
  F32x3 position{};
  F32x3 axis{};
  float angle = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("position", m.position, "m");
    v("axis", m.axis);
    v("angle", m.angle, "rad");
  }
};

struct SetHapticScale {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setHapticScale", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Scales the device's motion in the scene."};
  float scale = 1;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("scale", m.scale);
  }
};

struct SetSceneOrigin {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setSceneOrigin", Direction::kToServer,
                                     Reliability::kReliable, Role::scene, "Places the scene."};
  F32x3 position{};
  F32x3 axis{};
  float angle = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("position", m.position, "m");
    v("axis", m.axis);
    v("angle", m.angle, "rad");
  }
};

struct GetNewObjectId {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice getNewObjectID",
                                     Direction::kToServer,
                                     Reliability::kReliable,
                                     Role::control,
                                     "Is reserved: registered by stock libraries, never sent.",
                                     Access::command};
  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct SetObjectIsTouchable {
  static constexpr MessageInfo kInfo{"vrpn_ForceDevice setObjectIsTouchable", Direction::kToServer,
                                     Reliability::kReliable, Role::scene,
                                     "Starts (1) or stops (0) rendering an object."};
  std::int32_t object = 0;
  Bool16 touchable = 1;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("touchable", m.touchable);
  }
};

}  // namespace hapticd::wire

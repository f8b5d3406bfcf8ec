// Every command of a scene, named once: its number in the file and its fields.
//
// A new command gets a line in kCommands and a function of its own; without them nothing compiles. The
// structured bindings count the members, so that a new field does not compile either until it is listed. What
// a session file once had stays readable as long as numbers are never used again.
#pragma once

#include <concepts>
#include <tuple>

#include "scene/commands.h"

namespace hapticd::record {

template <class C, class T>
concept Is = std::same_as<std::remove_const_t<C>, T>;

/// A command, the number that stands for it in files, and its name for people.
template <class C>
struct CommandEntry {
  using Command = C;
  std::uint16_t number;
  const char* name;
};

inline constexpr std::tuple kCommands{
    CommandEntry<scene::SetObjectNumber>{1, "SetObjectNumber"},
    CommandEntry<scene::SetVertices>{2, "SetVertices"},
    CommandEntry<scene::SetTriangles>{3, "SetTriangles"},
    CommandEntry<scene::SetNormal>{4, "SetNormal"},
    CommandEntry<scene::RemoveTriangle>{5, "RemoveTriangle"},
    CommandEntry<scene::ClearMesh>{6, "ClearMesh"},
    CommandEntry<scene::TransformMesh>{7, "TransformMesh"},
    CommandEntry<scene::SetTrimeshType>{8, "SetTrimeshType"},
    CommandEntry<scene::AddObject>{9, "AddObject"},
    CommandEntry<scene::AddObjectExScene>{10, "AddObjectExScene"},
    CommandEntry<scene::MoveToParent>{11, "MoveToParent"},
    CommandEntry<scene::RemoveObject>{12, "RemoveObject"},
    CommandEntry<scene::SetTransform>{13, "SetTransform"},
    CommandEntry<scene::SetObjectPosition>{14, "SetObjectPosition"},
    CommandEntry<scene::SetObjectOrientation>{15, "SetObjectOrientation"},
    CommandEntry<scene::SetObjectScale>{16, "SetObjectScale"},
    CommandEntry<scene::SetTouchable>{17, "SetTouchable"},
    CommandEntry<scene::SetSurfaceProperty>{18, "SetSurfaceProperty"},
    CommandEntry<scene::SetSurface>{19, "SetSurface"},
    CommandEntry<scene::SetTouchableFaces>{20, "SetTouchableFaces"},
    CommandEntry<scene::SetWorkspaceProjection>{21, "SetWorkspaceProjection"},
    CommandEntry<scene::SetWorkspaceBox>{22, "SetWorkspaceBox"},
    CommandEntry<scene::SetHapticOrigin>{23, "SetHapticOrigin"},
    CommandEntry<scene::SetHapticScale>{24, "SetHapticScale"},
    CommandEntry<scene::SetSceneOrigin>{25, "SetSceneOrigin"},
    CommandEntry<scene::DefineEffect>{26, "DefineEffect"},
    CommandEntry<scene::StartEffect>{27, "StartEffect"},
    CommandEntry<scene::StopEffect>{28, "StopEffect"},
    CommandEntry<scene::SetPlane>{29, "SetPlane"},
    CommandEntry<scene::SetPlaneDetail>{30, "SetPlaneDetail"},
    CommandEntry<scene::SetForceField>{31, "SetForceField"},
    CommandEntry<scene::SetConstraintEnabled>{32, "SetConstraintEnabled"},
    CommandEntry<scene::SetConstraintMode>{33, "SetConstraintMode"},
    CommandEntry<scene::SetConstraintVector>{34, "SetConstraintVector"},
    CommandEntry<scene::SetConstraintStiffness>{35, "SetConstraintStiffness"},
    CommandEntry<scene::StartCustomEffect>{36, "StartCustomEffect"},
    CommandEntry<scene::StopCustomEffect>{37, "StopCustomEffect"},
    CommandEntry<scene::ResetScene>{38, "ResetScene"},
    CommandEntry<scene::BeginBatch>{39, "BeginBatch"},
    CommandEntry<scene::CommitBatch>{40, "CommitBatch"}};

template <Is<scene::SetObjectNumber> C, class V>
void fields(C& command, V&& v) {
  auto& [count] = command;
  v("count", count);
}

template <Is<scene::SetVertices> C, class V>
void fields(C& command, V&& v) {
  auto& [object, first, positions] = command;
  v("object", object);
  v("first", first);
  v("positions", positions);
}

template <Is<scene::SetTriangles> C, class V>
void fields(C& command, V&& v) {
  auto& [object, first, triangles, makesMetres] = command;
  v("object", object);
  v("first", first);
  v("triangles", triangles);
  v("makesMetres", makesMetres);
}

template <Is<scene::SetNormal> C, class V>
void fields(C& command, V&& v) {
  auto& [object] = command;
  v("object", object);
}

template <Is<scene::RemoveTriangle> C, class V>
void fields(C& command, V&& v) {
  auto& [object, triangle] = command;
  v("object", object);
  v("triangle", triangle);
}

template <Is<scene::ClearMesh> C, class V>
void fields(C& command, V&& v) {
  auto& [object] = command;
  v("object", object);
}

template <Is<scene::TransformMesh> C, class V>
void fields(C& command, V&& v) {
  auto& [object, matrix] = command;
  v("object", object);
  v("matrix", matrix);
}

template <Is<scene::SetTrimeshType> C, class V>
void fields(C& command, V&& v) {
  auto& [object, type] = command;
  v("object", object);
  v("type", type);
}

template <Is<scene::AddObject> C, class V>
void fields(C& command, V&& v) {
  auto& [object, parent] = command;
  v("object", object);
  v("parent", parent);
}

template <Is<scene::AddObjectExScene> C, class V>
void fields(C& command, V&& v) {
  auto& [object] = command;
  v("object", object);
}

template <Is<scene::MoveToParent> C, class V>
void fields(C& command, V&& v) {
  auto& [object, parent] = command;
  v("object", object);
  v("parent", parent);
}

template <Is<scene::RemoveObject> C, class V>
void fields(C& command, V&& v) {
  auto& [object] = command;
  v("object", object);
}

template <Is<scene::SetTransform> C, class V>
void fields(C& command, V&& v) {
  auto& [object, matrix] = command;
  v("object", object);
  v("matrix", matrix);
}

template <Is<scene::SetObjectPosition> C, class V>
void fields(C& command, V&& v) {
  auto& [object, position_m] = command;
  v("object", object);
  v("position_m", position_m);
}

template <Is<scene::SetObjectOrientation> C, class V>
void fields(C& command, V&& v) {
  auto& [object, axis, angle_rad] = command;
  v("object", object);
  v("axis", axis);
  v("angle_rad", angle_rad);
}

template <Is<scene::SetObjectScale> C, class V>
void fields(C& command, V&& v) {
  auto& [object, scale] = command;
  v("object", object);
  v("scale", scale);
}

template <Is<scene::SetTouchable> C, class V>
void fields(C& command, V&& v) {
  auto& [object, touchable] = command;
  v("object", object);
  v("touchable", touchable);
}

template <Is<scene::SetSurfaceProperty> C, class V>
void fields(C& command, V&& v) {
  auto& [object, name, value] = command;
  v("object", object);
  v("name", name);
  v("value", value);
}

template <Is<scene::SetSurface> C, class V>
void fields(C& command, V&& v) {
  auto& [object, stiffness, damping, staticFriction, dynamicFriction] = command;
  v("object", object);
  v("stiffness", stiffness);
  v("damping", damping);
  v("staticFriction", staticFriction);
  v("dynamicFriction", dynamicFriction);
}

template <Is<scene::SetTouchableFaces> C, class V>
void fields(C& command, V&& v) {
  auto& [faces] = command;
  v("faces", faces);
}

template <Is<scene::SetWorkspaceProjection> C, class V>
void fields(C& command, V&& v) {
  auto& [model, projection] = command;
  v("model", model);
  v("projection", projection);
}

template <Is<scene::SetWorkspaceBox> C, class V>
void fields(C& command, V&& v) {
  auto& [model, box] = command;
  v("model", model);
  v("box", box);
}

template <Is<scene::SetHapticOrigin> C, class V>
void fields(C& command, V&& v) {
  auto& [position_m, axis, angle_rad] = command;
  v("position_m", position_m);
  v("axis", axis);
  v("angle_rad", angle_rad);
}

template <Is<scene::SetHapticScale> C, class V>
void fields(C& command, V&& v) {
  auto& [scale] = command;
  v("scale", scale);
}

template <Is<scene::SetSceneOrigin> C, class V>
void fields(C& command, V&& v) {
  auto& [position_m, axis, angle_rad] = command;
  v("position_m", position_m);
  v("axis", axis);
  v("angle_rad", angle_rad);
}

template <Is<scene::DefineEffect> C, class V>
void fields(C& command, V&& v) {
  auto& [type, index, gain, magnitude_N, duration_ms, frequency, position, direction] = command;
  v("type", type);
  v("index", index);
  v("gain", gain);
  v("magnitude_N", magnitude_N);
  v("duration_ms", duration_ms);
  v("frequency", frequency);
  v("position", position);
  v("direction", direction);
}

template <Is<scene::StartEffect> C, class V>
void fields(C& command, V&& v) {
  auto& [index] = command;
  v("index", index);
}

template <Is<scene::StopEffect> C, class V>
void fields(C& command, V&& v) {
  auto& [index] = command;
  v("index", index);
}

template <Is<scene::SetPlane> C, class V>
void fields(C& command, V&& v) {
  auto& [index, plane, stiffness, damping, staticFriction, dynamicFriction, recoveryCycles] = command;
  v("index", index);
  v("plane", plane);
  v("stiffness", stiffness);
  v("damping", damping);
  v("staticFriction", staticFriction);
  v("dynamicFriction", dynamicFriction);
  v("recoveryCycles", recoveryCycles);
}

template <Is<scene::SetPlaneDetail> C, class V>
void fields(C& command, V&& v) {
  auto& [adhesionNormal_N, adhesionLateral_N, textureAmplitude_m, textureWavelength_m, buzzAmplitude_m,
         buzzFrequency_Hz] = command;
  v("adhesionNormal_N", adhesionNormal_N);
  v("adhesionLateral_N", adhesionLateral_N);
  v("textureAmplitude_m", textureAmplitude_m);
  v("textureWavelength_m", textureWavelength_m);
  v("buzzAmplitude_m", buzzAmplitude_m);
  v("buzzFrequency_Hz", buzzFrequency_Hz);
}

template <Is<scene::SetForceField> C, class V>
void fields(C& command, V&& v) {
  auto& [origin_m, force_N, jacobian_N_per_m, radius_m] = command;
  v("origin_m", origin_m);
  v("force_N", force_N);
  v("jacobian_N_per_m", jacobian_N_per_m);
  v("radius_m", radius_m);
}

template <Is<scene::SetConstraintEnabled> C, class V>
void fields(C& command, V&& v) {
  auto& [enabled] = command;
  v("enabled", enabled);
}

template <Is<scene::SetConstraintMode> C, class V>
void fields(C& command, V&& v) {
  auto& [mode] = command;
  v("mode", mode);
}

template <Is<scene::SetConstraintVector> C, class V>
void fields(C& command, V&& v) {
  auto& [which, value] = command;
  v("which", which);
  v("value", value);
}

template <Is<scene::SetConstraintStiffness> C, class V>
void fields(C& command, V&& v) {
  auto& [stiffness_N_per_m] = command;
  v("stiffness_N_per_m", stiffness_N_per_m);
}

template <Is<scene::StartCustomEffect> C, class V>
void fields(C& command, V&& v) {
  auto& [effect, parameters] = command;
  v("effect", effect);
  v("parameters", parameters);
}

template <Is<scene::StopCustomEffect> C, class V>
void fields(C&, V&&) {
  static_assert(std::is_empty_v<C>);
}

template <Is<scene::ResetScene> C, class V>
void fields(C&, V&&) {
  static_assert(std::is_empty_v<C>);
}

template <Is<scene::BeginBatch> C, class V>
void fields(C&, V&&) {
  static_assert(std::is_empty_v<C>);
}

template <Is<scene::CommitBatch> C, class V>
void fields(C&, V&&) {
  static_assert(std::is_empty_v<C>);
}

namespace detail {

template <class C>
constexpr int timesListed() {
  return std::apply(
      [](const auto&... entry) {
        return (0 + ... + int{std::same_as<typename std::remove_cvref_t<decltype(entry)>::Command, C>});
      },
      kCommands);
}

template <class... C>
constexpr bool eachListedOnce(const std::variant<C...>*) {
  return ((timesListed<C>() == 1) && ...);
}

constexpr bool numbersDiffer() {
  return std::apply(
      [](const auto&... entry) {
        const std::uint16_t numbers[] = {entry.number...};
        for (std::size_t i = 0; i < std::size(numbers); ++i) {
          for (std::size_t k = 0; k < i; ++k) {
            if (numbers[i] == numbers[k]) return false;
          }
        }
        return true;
      },
      kCommands);
}

}  // namespace detail

static_assert(detail::eachListedOnce(static_cast<const scene::SceneCommand*>(nullptr)),
              "a command of the scene is missing in kCommands, or there twice");
static_assert(detail::numbersDiffer(), "two commands have the same number");

}  // namespace hapticd::record

// The one table of all messages. A message is a plain struct with its description beside it: kInfo (wire
// name, direction, reliability, meaning) and fields() (name, value and unit of each field, in wire order).
// Encoder, decoder, size check, docs/wire-messages.md and the fuzz dictionary are all derived from it.
//
// To add a message (for example `hapticd Mesh_Vertices`): write its struct in messages/, append it to the END of
// Message below, and regenerate the docs with `wire_docs markdown > docs/wire-messages.md`. Nothing else
// changes: peers learn its name in the handshake, and peers that do not know the name never mind it.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>
#include <variant>

#include "wire/messages/analog.h"
#include "wire/messages/base.h"
#include "wire/messages/button.h"
#include "wire/messages/extension.h"
#include "wire/messages/force_device.h"
#include "wire/messages/force_device_uma.h"
#include "wire/messages/scene.h"
#include "wire/messages/tracker.h"

namespace hapticd::wire {

/// Any message; its index in this list is its MessageKind.
using Message = std::variant<
    // Every device
    Text, Ping, Pong,
    // Force device: reports and what its driver renders
    Force, Scp, ForceError, ForceField, Plane, Plane2, CustomEffect, ConstraintEnable, ConstraintMode,
    ConstraintPoint, ConstraintLinePoint, ConstraintLineDirection, ConstraintPlanePoint,
    ConstraintPlaneNormal, ConstraintStiffness,
    // Force device: scene
    AddObject, AddObjectExScene, MoveToParent, SetObjectPosition, SetObjectOrientation, SetObjectScale,
    RemoveObject, SetVertex, SetNormal, SetTriangle, RemoveTriangle, UpdateTrimeshChanges, TransformTrimesh,
    SetTrimeshType, ClearTrimesh, SetHapticOrigin, SetHapticScale, SetSceneOrigin, GetNewObjectId,
    SetObjectIsTouchable,
    // Force device: University of Malaga
    SetWorkspaceBoundingBox, SetWorkspaceProjectionMatrix, SetObjectNumber, SetTransformMatrix,
    SetHapticProperty, SetTouchableFace, Effect, StartEffect, StopEffect, ResetScene, Dop, IsTouching,
    TouchedObject, Angle,
    // Tracker
    TrackerPosQuat, TrackerVelocity, TrackerAcceleration, TrackerToRoom, TrackerUnitToSensor,
    TrackerWorkspace, TrackerRequestToRoom, TrackerRequestUnitToSensor, TrackerRequestWorkspace,
    TrackerSetUpdateRate, TrackerResetOrigin,
    // Button
    ButtonChange, ButtonStates, ButtonAdmin, ButtonAlert,
    // Analog
    AnalogChannels,
    // Our own
    QueryCapabilities, Capabilities, MeshVertices, MeshTriangles, BatchBegin, BatchCommit, Subscribe,
    TickReport, ContactList, StopForces, RearmForces, GuardState, Heartbeat, HoldHand>;

/// Which message: a small integer for switch and table look-up, `case kindOf<SetVertex>:`.
enum class MessageKind : std::uint8_t {};

inline constexpr std::size_t kMessageKinds = std::variant_size_v<Message>;
/// A name of a peer's that is not in the table.
inline constexpr MessageKind kUnknownKind{255};
static_assert(kMessageKinds < 255);

/// The struct of a kind.
template <MessageKind K>
using MessageOf = std::variant_alternative_t<static_cast<std::size_t>(K), Message>;

namespace detail {

template <class M, std::size_t... I>
constexpr std::size_t indexOf(std::index_sequence<I...>) {
  std::size_t index = kMessageKinds;
  ((std::same_as<M, std::variant_alternative_t<I, Message>> ? void(index = I) : void()), ...);
  return index;
}

template <std::size_t... I>
constexpr std::array<MessageInfo, kMessageKinds> collectInfos(std::index_sequence<I...>) {
  return {std::variant_alternative_t<I, Message>::kInfo...};
}

}  // namespace detail

/// One of the structs in the table.
template <class M>
concept WireMessage = detail::indexOf<M>(std::make_index_sequence<kMessageKinds>{})
< kMessageKinds;

/// The kind of a struct.
template <WireMessage M>
inline constexpr MessageKind kindOf{
    static_cast<std::uint8_t>(detail::indexOf<M>(std::make_index_sequence<kMessageKinds>{}))};

/// The kind of a message.
inline MessageKind kind(const Message& message) noexcept {
  return MessageKind{static_cast<std::uint8_t>(message.index())};
}

/// Name, direction, reliability and meaning of every kind, by kind.
inline constexpr std::array<MessageInfo, kMessageKinds> kMessageInfos =
    detail::collectInfos(std::make_index_sequence<kMessageKinds>{});

/// Name, direction, reliability and meaning; the kind must not be kUnknownKind.
constexpr const MessageInfo& info(MessageKind kind) noexcept {
  return kMessageInfos[static_cast<std::size_t>(kind)];
}

/// The kind with this wire name, or kUnknownKind.
constexpr MessageKind kindNamed(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    if (kMessageInfos[i].name == name) return MessageKind{static_cast<std::uint8_t>(i)};
  }
  return kUnknownKind;
}

}  // namespace hapticd::wire

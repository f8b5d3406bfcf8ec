// The one table of all messages. A message is a plain struct with its description beside it: kInfo (wire
// name, direction, reliability, role, meaning) and fields() (name, value and unit of each field, in wire
// order). Encoder, decoder, size check, dispatch, docs/wire-messages.md and the fuzz dictionary are all
// derived from it.
//
// To add a message (for example `hapticd Mesh_Vertices`): write its struct in messages/, append it to the END
// of AllMessages below, and regenerate the docs with `wire_docs markdown > docs/wire-messages.md`. The server
// does not compile until it handles a new control message or scene command. Peers learn the name in the
// handshake, and peers that do not know the name ignore it.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>
#include <utility>

#include "wire/messages/analog.h"
#include "wire/messages/base.h"
#include "wire/messages/button.h"
#include "wire/messages/extension.h"
#include "wire/messages/force_device.h"
#include "wire/messages/force_device_uma.h"
#include "wire/messages/scene.h"
#include "wire/messages/tracker.h"

namespace hapticd::wire {

/// Message structs as a list of types.
template <class... M>
struct MessageList {
  static constexpr std::size_t kSize = sizeof...(M);
};

/// Every message; the index in this list is its MessageKind.
using AllMessages = MessageList<
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
    TickReport, ContactList, StopForces, RearmForces, GuardState, Heartbeat, HoldHand, RemoteContacts,
    HeldForce, HandState, Identify, ReleaseControl, Poses, SetObjectName, Marker, ReplayControl,
    RecordingControl>;

/// Which message: a small integer for switch and table look-up, `case kindOf<SetVertex>:`.
enum class MessageKind : std::uint8_t {};

inline constexpr std::size_t kMessageKinds = AllMessages::kSize;
/// A name of a peer's that is not in the table.
inline constexpr MessageKind kUnknownKind{255};
static_assert(kMessageKinds < 255);

namespace detail {

inline constexpr auto kNowhere = static_cast<std::size_t>(-1);

template <std::size_t I, class M>
struct Entry {};

/// Entry<I, M> for each struct M of the list, I its position.
template <class Positions, class... All>
struct Entries;
template <std::size_t... I, class... All>
struct Entries<std::index_sequence<I...>, All...> : Entry<I, All>... {};

/// The compiler finds the entry of M among the bases: comparing M with all structs of the list takes it half
/// a second for each file that uses the table.
template <class M, std::size_t I>
consteval std::size_t positionIn(const Entry<I, M>* /*entries*/) {
  return I;
}
template <class M>
consteval std::size_t positionIn(const void* /*entries*/) {
  return kNowhere;
}

/// Position of M in the list; kNowhere when it is not there.
template <class M, class... All>
consteval std::size_t indexIn(MessageList<All...>) {
  return positionIn<M>(static_cast<const Entries<std::index_sequence_for<All...>, All...>*>(nullptr));
}

template <class... All>
consteval std::array<MessageInfo, sizeof...(All)> infosOf(MessageList<All...>) {
  return {All::kInfo...};
}

}  // namespace detail

/// Calls `visit.operator()<M>()` for each struct of the list, in order.
template <class... M, class Visit>
constexpr void forEachMessage(MessageList<M...>, Visit&& visit) {
  (visit.template operator()<M>(), ...);
}

/// One of the structs in the table.
template <class M>
concept WireMessage = detail::indexIn<M>(AllMessages{})
!= detail::kNowhere;

/// The kind of a struct.
template <WireMessage M>
inline constexpr MessageKind kindOf{static_cast<std::uint8_t>(detail::indexIn<M>(AllMessages{}))};

/// The descriptions of all kinds, by kind.
inline constexpr std::array<MessageInfo, kMessageKinds> kMessageInfos = detail::infosOf(AllMessages{});

/// The description of a kind, which must not be kUnknownKind.
constexpr const MessageInfo& info(MessageKind kind) noexcept {
  return kMessageInfos[static_cast<std::size_t>(kind)];
}

/// What the message is to the server; Role::unknown for kUnknownKind.
constexpr Role role(MessageKind kind) noexcept {
  return kind == kUnknownKind ? Role::unknown : info(kind).role;
}

/// Who may send it; Access::free for kUnknownKind.
constexpr Access access(MessageKind kind) noexcept {
  return kind == kUnknownKind ? Access::free : info(kind).access;
}

/// Whether not every client may send it: it changes what others feel.
constexpr bool needsControl(MessageKind kind) noexcept {
  return access(kind) != Access::free;
}

/// Whether the server handles it before scene commands that the same client sent earlier.
constexpr bool overtakes(MessageKind kind) noexcept {
  return kind != kUnknownKind && info(kind).order == Order::overtaking;
}

/// The kind with this wire name, or kUnknownKind.
constexpr MessageKind kindNamed(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    if (kMessageInfos[i].name == name) return MessageKind{static_cast<std::uint8_t>(i)};
  }
  return kUnknownKind;
}

}  // namespace hapticd::wire

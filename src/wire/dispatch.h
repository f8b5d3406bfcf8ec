// From a payload to the handler of its struct. A role without a complete set of handlers does not compile, so
// a new message in the table cannot be forgotten.
#pragma once

#include <array>
#include <concepts>
#include <utility>

#include "wire/codec.h"

namespace hapticd::wire {

namespace detail {

Error wrongRole(MessageKind kind, Role expected);

template <class M, class Handler>
Result<void> decodeAndHandle(ByteView payload, Handler& handler) {
  static_assert(std::invocable<Handler&, const M&>, "the handler has no overload for this message");
  M message;
  Result<void> decoded = decodeInto(kindOf<M>, payload, &message);
  if (decoded) handler(std::as_const(message));
  return decoded;
}

template <class Handler>
using DispatchTable = std::array<Result<void> (*)(ByteView, Handler&), kMessageKinds>;

// Null for the messages of other roles.
template <Role R, class Handler, class M>
consteval Result<void> (*entryFor())(ByteView, Handler&) {
  if constexpr (M::kInfo.role == R) {
    return &decodeAndHandle<M, Handler>;
  } else {
    return nullptr;
  }
}

template <Role R, class Handler, class... All>
consteval DispatchTable<Handler> dispatchTable(MessageList<All...>) {
  return {entryFor<R, Handler, All>()...};
}

template <Role R, class Handler>
Result<void> dispatch(MessageKind kind, ByteView payload, Handler& handler) {
  if (role(kind) != R) return wrongRole(kind, R);
  static constexpr DispatchTable<Handler> kTable = dispatchTable<R, Handler>(AllMessages{});
  return kTable[static_cast<std::size_t>(kind)](payload, handler);
}

}  // namespace detail

/// Whether a handler can be called with every struct of a role among those of the list.
template <Role R, class Handler, class... All>
consteval bool handlesAll(MessageList<All...>) {
  return ((All::kInfo.role != R || std::invocable<Handler&, const All&>)&&...);
}

/// Decodes a control message and calls `handler(const M&)` with it. The handler has one overload for each
/// struct of that role; a missing one does not compile. An error is a malformed payload, or a kind of
/// another role (a mistake of the caller: ask role() first), and then the handler is not called.
template <class Handler>
Result<void> dispatchControl(MessageKind kind, ByteView payload, Handler&& handler) {
  return detail::dispatch<Role::control>(kind, payload, handler);
}

/// The same for scene commands.
template <class Handler>
Result<void> dispatchScene(MessageKind kind, ByteView payload, Handler&& handler) {
  return detail::dispatch<Role::scene>(kind, payload, handler);
}

}  // namespace hapticd::wire

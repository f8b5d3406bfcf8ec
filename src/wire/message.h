// Any message of the table as one value. Copying, destroying and encoding are compiled once, in message.cpp:
// a std::variant of so many structs costs every file that holds one several seconds of compile time.
#pragma once

#include <array>
#include <cstddef>
#include <new>
#include <type_traits>
#include <utility>

#include "wire/bytes.h"
#include "wire/messages.h"
#include "wire/result.h"

namespace hapticd::wire {

namespace detail {

struct Layout {
  std::size_t bytes = 0;
  std::size_t alignment = 1;
};

template <class... M>
consteval Layout largestOf(MessageList<M...>) {
  Layout layout;
  ((layout.bytes = sizeof(M) > layout.bytes ? sizeof(M) : layout.bytes), ...);
  ((layout.alignment = alignof(M) > layout.alignment ? alignof(M) : layout.alignment), ...);
  return layout;
}

inline constexpr Layout kLargestMessage = largestOf(AllMessages{});

}  // namespace detail

/// Holds one struct of the table, in place: about 260 bytes, and no allocation besides that of the struct
/// itself.
class Message {
 public:
  template <class M>
  requires WireMessage<std::remove_cvref_t<M>> Message(M&& message) : kind_(kindOf<std::remove_cvref_t<M>>) {
    using Struct = std::remove_cvref_t<M>;
    static_assert(std::is_nothrow_move_constructible_v<Struct>);
    ::new (data()) Struct(std::forward<M>(message));
  }
  /// The struct of this kind with its default values; the kind must not be kUnknownKind.
  explicit Message(MessageKind kind);

  Message(const Message& other);
  /// Afterwards `other` is of the same kind, with unspecified values.
  Message(Message&& other) noexcept;
  Message& operator=(const Message& other);
  Message& operator=(Message&& other) noexcept;
  ~Message();

  MessageKind kind() const noexcept { return kind_; }
  /// The struct, or null when the message is of another kind.
  template <WireMessage M>
  const M* as() const noexcept {
    return kind_ == kindOf<M> ? std::launder(static_cast<const M*>(data())) : nullptr;
  }

  /// The struct as raw memory, for functions that take a kind with it.
  void* data() noexcept { return bytes_.data(); }
  const void* data() const noexcept { return bytes_.data(); }

 private:
  alignas(detail::kLargestMessage.alignment) std::array<std::byte, detail::kLargestMessage.bytes> bytes_;
  MessageKind kind_;
};

/// Payload bytes of this message without padding; std::length_error when a list is longer than its type
/// allows.
std::size_t payloadSize(const Message& message);

/// Writes payloadSize(message) bytes to out.
void encodePayload(const Message& message, std::byte* out);

/// Reads one payload of a kind known at run time; kUnknownKind is an error.
Result<Message> decode(MessageKind kind, ByteView payload);

/// Reads one payload into `message`, which must point to a struct of this kind; on an error the struct stays
/// as it is. Cheaper to build than decode<M>(), and a little slower to run.
Result<void> decodeInto(MessageKind kind, ByteView payload, void* message);

}  // namespace hapticd::wire

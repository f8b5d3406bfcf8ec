#include "wire/message.h"

#include <memory>

#include "wire/codec.h"

namespace hapticd::wire {

namespace {

// What a Message does with its struct.
struct Operations {
  void (*create)(void* to);
  void (*copy)(void* to, const void* from);
  void (*move)(void* to, void* from) noexcept;
  void (*destroy)(void* message) noexcept;
  std::size_t (*size)(const void* message);
  void (*encode)(const void* message, std::byte* out);
  Result<void> (*decode)(ByteView payload, void* message);
};

template <class M>
struct OperationsOf {
  static void create(void* to) { ::new (to) M{}; }
  static void copy(void* to, const void* from) { ::new (to) M(*static_cast<const M*>(from)); }
  static void move(void* to, void* from) noexcept { ::new (to) M(std::move(*static_cast<M*>(from))); }
  static void destroy(void* message) noexcept { std::destroy_at(static_cast<M*>(message)); }
  static std::size_t size(const void* message) { return payloadSize(*static_cast<const M*>(message)); }
  static void encode(const void* message, std::byte* out) {
    encodePayload(*static_cast<const M*>(message), out);
  }
  static Result<void> decode(ByteView payload, void* message) {
    Result<M> decoded = wire::decode<M>(payload);
    if (!decoded) return Error{decoded.error()};
    *static_cast<M*>(message) = *std::move(decoded);
    return {};
  }
};

template <class... M>
constexpr std::array<Operations, kMessageKinds> operationsOf(MessageList<M...>) {
  return {Operations{&OperationsOf<M>::create, &OperationsOf<M>::copy, &OperationsOf<M>::move,
                     &OperationsOf<M>::destroy, &OperationsOf<M>::size, &OperationsOf<M>::encode,
                     &OperationsOf<M>::decode}...};
}

constexpr std::array<Operations, kMessageKinds> kOperations = operationsOf(AllMessages{});

const Operations& operations(MessageKind kind) noexcept {
  return kOperations[static_cast<std::size_t>(kind)];
}

}  // namespace

Message::Message(MessageKind kind) : kind_(kind) {
  operations(kind).create(data());
}

Message::Message(const Message& other) : kind_(other.kind_) {
  operations(kind_).copy(data(), other.data());
}

Message::Message(Message&& other) noexcept : kind_(other.kind_) {
  operations(kind_).move(data(), other.data());
}

Message& Message::operator=(const Message& other) {
  if (this != &other) *this = Message(other);
  return *this;
}

Message& Message::operator=(Message&& other) noexcept {
  if (this == &other) return *this;
  operations(kind_).destroy(data());
  kind_ = other.kind_;
  operations(kind_).move(data(), other.data());
  return *this;
}

Message::~Message() {
  operations(kind_).destroy(data());
}

std::size_t payloadSize(const Message& message) {
  return operations(message.kind()).size(message.data());
}

void encodePayload(const Message& message, std::byte* out) {
  operations(message.kind()).encode(message.data(), out);
}

Result<void> decodeInto(MessageKind kind, ByteView payload, void* message) {
  const auto index = static_cast<std::size_t>(kind);
  if (index >= kMessageKinds) return Error{"message kind " + std::to_string(index) + " is not in the table"};
  return operations(kind).decode(payload, message);
}

Result<Message> decode(MessageKind kind, ByteView payload) {
  if (static_cast<std::size_t>(kind) >= kMessageKinds)
    return Error{decodeInto(kind, payload, nullptr).error()};
  Message message(kind);
  const Result<void> decoded = decodeInto(kind, payload, message.data());
  if (!decoded) return Error{decoded.error()};
  return message;
}

}  // namespace hapticd::wire

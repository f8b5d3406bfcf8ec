#include "wire/codec.h"

#include <cstdio>

namespace hapticd::wire {

namespace detail {

Error wrongSize(std::string_view name, std::size_t got, std::size_t expected, bool at_least) {
  return {std::string(name) + ": payload of " + std::to_string(got) + " bytes, expected " +
          (at_least ? "at least " : "") + std::to_string(expected)};
}

std::string wrongCount(std::string_view field, double count, std::size_t room, std::size_t most) {
  std::array<char, 32> digits{};
  std::snprintf(digits.data(), digits.size(), "%.17g", count);
  return std::string(field) + " counts " + digits.data() + " values, room for " + std::to_string(room) +
         ", at most " + std::to_string(most);
}

std::string tooLong(std::string_view field, std::size_t count, std::size_t most) {
  return std::string(field) + ": " + std::to_string(count) + " values, at most " + std::to_string(most);
}

}  // namespace detail

namespace {

using Decoder = Result<void> (*)(ByteView, void*);

template <class M>
Result<void> decodeAs(ByteView payload, void* message) {
  Result<M> decoded = decode<M>(payload);
  if (!decoded) return Error{decoded.error()};
  *static_cast<M*>(message) = *std::move(decoded);
  return {};
}

template <class... M>
constexpr std::array<Decoder, kMessageKinds> decodersOf(MessageList<M...>) {
  return {&decodeAs<M>...};
}
constexpr auto kDecoders = decodersOf(AllMessages{});

using AnyDecoder = Result<Message> (*)(ByteView);

template <class M>
Result<Message> decodeAny(ByteView payload) {
  Result<M> decoded = decode<M>(payload);
  if (!decoded) return Error{decoded.error()};
  return Message(*std::move(decoded));
}

template <class... M>
constexpr std::array<AnyDecoder, kMessageKinds> anyDecodersOf(MessageList<M...>) {
  return {&decodeAny<M>...};
}
constexpr auto kAnyDecoders = anyDecodersOf(AllMessages{});

Error notInTable(std::size_t index) {
  return {"message kind " + std::to_string(index) + " is not in the table"};
}

}  // namespace

Result<void> decodeInto(MessageKind kind, ByteView payload, void* message) {
  const auto index = static_cast<std::size_t>(kind);
  if (index >= kMessageKinds) return notInTable(index);
  return kDecoders[index](payload, message);
}

Result<Message> decode(MessageKind kind, ByteView payload) {
  const auto index = static_cast<std::size_t>(kind);
  if (index >= kMessageKinds) return notInTable(index);
  return kAnyDecoders[index](payload);
}

}  // namespace hapticd::wire

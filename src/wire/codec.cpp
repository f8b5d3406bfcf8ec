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

}  // namespace detail

namespace {

using Decoder = Result<Message> (*)(ByteView);

template <class M>
Result<Message> decodeAs(ByteView payload) {
  Result<M> decoded = decode<M>(payload);
  if (!decoded) return Error{decoded.error()};
  return Message(*std::move(decoded));
}

template <std::size_t... I>
constexpr std::array<Decoder, kMessageKinds> makeDecoders(std::index_sequence<I...>) {
  return {&decodeAs<std::variant_alternative_t<I, Message>>...};
}

constexpr auto kDecoders = makeDecoders(std::make_index_sequence<kMessageKinds>{});

}  // namespace

Result<Message> decode(MessageKind kind, ByteView payload) {
  const auto index = static_cast<std::size_t>(kind);
  if (index >= kMessageKinds) return Error{"message kind " + std::to_string(index) + " is not in the table"};
  return kDecoders[index](payload);
}

}  // namespace hapticd::wire

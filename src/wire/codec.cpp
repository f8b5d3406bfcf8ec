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

}  // namespace hapticd::wire

// SHA-1 and base64, which the greeting of a WebSocket is made of. Protects nothing: do not use it elsewhere.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace hapticd::net {

std::array<std::uint8_t, 20> sha1(std::string_view text);
std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace hapticd::net

// The 24 bytes each side of a TCP connection sends first: version, and the logging it asks of its peer.
#pragma once

#include <array>
#include <string>

#include "wire/bytes.h"
#include "wire/result.h"

namespace hapticd::wire {

inline constexpr std::size_t kCookieBytes = 24;
/// The version we announce. Peers compare up to the last dot: any 07.xx accepts any other.
inline constexpr std::string_view kVersionText = "vrpn: ver. 07.38";

/// The contents of a peer's cookie.
struct Cookie {
  std::string version;  ///< such as "07.34"
  int log_mode = 0;     ///< logging asked of the receiver: bit 0 its incoming, bit 1 its outgoing messages
};

/// Our cookie, asking for this log mode (0 to 3).
std::array<std::byte, kCookieBytes> encodeCookie(int log_mode);

/// Reads a peer's kCookieBytes bytes; another major version or log mode is an error that quotes them.
Result<Cookie> decodeCookie(ByteView bytes);

}  // namespace hapticd::wire

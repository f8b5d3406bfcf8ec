// IPv4 addresses, and the error type of this room.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace hapticd::net {

/// A socket could not be opened or a name not resolved; what() names the address and, where there is one, the
/// remedy.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// 127.0.0.1 in host byte order.
inline constexpr std::uint32_t kLoopbackAddress = 0x7f000001;
/// Whether an address (host byte order) is in 127.0.0.0/8.
constexpr bool isLoopback(std::uint32_t address) {
  return (address >> 24) == 127;
}
/// 0.0.0.0: when listening, every address of this machine.
inline constexpr std::uint32_t kAnyAddress = 0;

/// An IPv4 address and a port, both in host byte order.
struct Endpoint {
  std::uint32_t address = kAnyAddress;
  std::uint16_t port = 0;

  /// "127.0.0.1:3883".
  std::string text() const;
  /// "127.0.0.1".
  std::string addressText() const;
  /// Reads "ADDRESS:PORT", or "ADDRESS" with the given port; numbers only, throws Error on anything else.
  static Endpoint parse(std::string_view text, std::uint16_t defaultPort = 0);

  friend bool operator==(const Endpoint&, const Endpoint&) = default;
};

/// The first IPv4 address (host byte order) of a host name or dotted quad; may block for seconds in the
/// system's resolver, throws Error when there is none.
std::uint32_t resolve(const std::string& host);

/// The address (host byte order) of this machine that packets to the host leave from; sends nothing, but may
/// block in resolve(); throws Error when no route leads there.
std::uint32_t localAddressTowards(const std::string& host);

}  // namespace hapticd::net

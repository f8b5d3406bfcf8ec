// What a server says of itself on the network by DNS-SD, as _hapticd._tcp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace hapticd::zeroconf {

inline constexpr const char* kServiceType = "_hapticd._tcp";
/// Bytes of a name (RFC 6763, 4.1.1).
inline constexpr std::size_t kLongestName = 63;

struct AnnouncedServer {
  std::string name{};     ///< for people: "hapticd on lab7"
  std::string address{};  ///< dotted IPv4; empty in an announcement: the machine's own
  std::uint16_t port{};   ///< of VRPN, TCP and UDP
  std::vector<std::string> devices{};
  std::uint16_t pagePort{};  ///< 0: no page for other machines
  bool tls = false;          ///< the port requires TLS
  std::string version{};

  /// The TXT record: "key=value" of at most 255 bytes each. Devices that do not fit are left out.
  std::vector<std::string> text() const;
  /// Reads the TXT record of another server, made printable; what it does not know it ignores.
  void read(const std::vector<std::string>& text);

  /// What a client opens: "Phantom@192.168.1.7:3883".
  std::string client(const std::string& device) const;
  /// "http://192.168.1.7:8080/", by https where the port requires TLS, or empty.
  std::string page() const;

  friend bool operator==(const AnnouncedServer&, const AnnouncedServer&) = default;
};

}  // namespace hapticd::zeroconf

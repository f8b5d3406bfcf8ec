// Who a client is to the server: its role, and how the server knows.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "scene/notice.h"

namespace hapticd::server {

/// In the order of rights; each has those of the roles before it.
enum class ClientRole : std::uint8_t {
  observer,   ///< reads reports, and may stop the forces
  operating,  ///< "operator": re-arms, holds the simulated hand
  owner,      ///< commands the scene and its forces, as `control` permits
};

constexpr std::string_view nameOf(ClientRole role) {
  return role == ClientRole::owner ? "owner" : role == ClientRole::operating ? "operator" : "observer";
}

/// What counts as one address: every address of this machine's loopback is the same.
inline std::string sourceOf(std::string_view address) {
  return std::string(address.starts_with("127.") ? "127.0.0.1" : address);
}

struct Identity {
  ClientRole role = ClientRole::owner;
  /// By a token or a user id, not by the address alone.
  bool proven = false;
};

/// Who sends commands: a session, or a client of another port.
struct Commander {
  scene::ClientId id = 0;
  std::string address;
  Identity identity;
};

}  // namespace hapticd::server

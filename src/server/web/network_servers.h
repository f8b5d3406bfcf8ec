// The servers of the network, for the page: values, the seam by which they are found, and their JSON.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace hapticd::server {

/// A server that announces itself. The texts come from other machines.
struct NetworkServer {
  std::string name{};
  std::string address{};
  std::uint16_t port{};                ///< of VRPN, TCP and UDP
  std::vector<std::string> devices{};  ///< as a client opens them: "Phantom@192.168.1.7:3883"
  std::string page{};                  ///< address of its page; empty: none
  bool tls = false;
  std::string version{};
  bool thisServer = false;
};

struct NetworkSearch {
  std::vector<NetworkServer> servers{};
  std::string reason{};  ///< why the network could not be searched; empty when it was
};

/// Searches the network in a thread of its own.
class ServerFinder {
 public:
  using Done = std::function<void(NetworkSearch)>;
  /// Ends a search; `done` may be called until then.
  virtual ~ServerFinder() = default;
  /// Net thread; never waits. Calls `done` once, from any thread. Called again only after that.
  virtual void find(Done done) = 0;
};

/// Any machine of the network can announce as many servers, of any name, as it likes: the rest is left out.
inline constexpr std::size_t kMostServers = 100;
inline constexpr std::size_t kMostDevicesOfServer = 16;
inline constexpr std::size_t kLongestServerText = 100;  ///< bytes

/// Body of /api/servers. docs/viewer.md lists the fields.
std::string serversJson(NetworkSearch search);

}  // namespace hapticd::server

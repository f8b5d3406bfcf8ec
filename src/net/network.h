// Where event loops and names come from: the machine, or a simulated network.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "net/loop.h"

namespace hapticd::net {

/// Makes loops; all sockets and timers are made by a loop (loop_impl.h), so they belong to the same network.
class Network {
 public:
  virtual ~Network() = default;
  /// May throw what the system says.
  virtual std::unique_ptr<Loop::Impl> makeLoop() = 0;
  /// See resolve() and localAddressTowards() in endpoint.h.
  virtual std::uint32_t resolve(const std::string& host) = 0;
  virtual std::uint32_t localAddressTowards(const std::string& host) = 0;
};

/// The machine's network, or the one that a ScopedNetwork put in its place. From any thread.
Network& network() noexcept;

/// Replaces the network while it lives. Make it before, and destroy it after, every Loop of that network; one
/// at a time.
class ScopedNetwork {
 public:
  explicit ScopedNetwork(Network& network) noexcept;
  ~ScopedNetwork();
  ScopedNetwork(const ScopedNetwork&) = delete;
  ScopedNetwork& operator=(const ScopedNetwork&) = delete;
};

}  // namespace hapticd::net

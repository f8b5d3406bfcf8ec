// A network in memory, in one thread, on a clock that the test controls: the same calls give the same events.
//
// All loops of the network share one queue of events, ordered by time. Whichever loop runs handles the events
// of all of them, so that a server and its clients make progress together; the clock jumps from event to
// event. A connection behaves as the TCP connections of src/net do: callbacks only from the loop, a bounded
// window, the same reasons.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "net/loop_impl.h"
#include "net/network.h"

namespace hapticd::net {

class FakeLoop;
class FakeListener;
class FakeUdpSocket;
class FakeConnection;
class FakeWatch;

/// How bytes and datagrams travel; a change holds for what is sent or read afterwards.
struct FakeNetworkOptions {
  base::Nanos delay = 50'000;                         ///< one way
  std::size_t windowBytes = std::size_t{256} * 1024;  ///< sent but not yet read by the peer's program
  /// How many of the bytes that have arrived one read returns (clamped to 1 ... available); empty: up to 64
  /// KiB.
  std::function<std::size_t(std::size_t available)> readSize = {};
  /// Whether the datagram of this number (from 0, over all sockets) is lost; empty: none.
  std::function<bool(std::uint64_t number)> losesDatagram = {};
};

class FakeNetwork final : public Network {
 public:
  /// The clock is advanced by sleepUntil(); it outlives the network, which outlives its loops.
  explicit FakeNetwork(base::Clock& clock) : clock_(clock) {}

  std::unique_ptr<Loop::Impl> makeLoop() override;
  /// Numbers, "localhost" and what `hosts` names.
  std::uint32_t resolve(const std::string& host) override;
  std::uint32_t localAddressTowards(const std::string& host) override;

  FakeNetworkOptions options;
  std::map<std::string, std::uint32_t> hosts;

  /// From now on nothing of this connection arrives, either way, as if the cable were cut.
  void cut(const Endpoint& oneEnd);
  /// A reset reaches both ends after the delay.
  void reset(const Endpoint& oneEnd);

  base::Nanos time() const noexcept { return clock_.now(); }
  /// When the next event is due; nothing when there is none. For simulators that have further sources of
  /// events.
  std::optional<base::Nanos> next();
  /// Advances the clock to the next event and handles it; false when none is due up to `limit`.
  bool runNext(base::Nanos limit);
  /// Handled so far.
  std::uint64_t events() const noexcept { return events_; }

 private:
  friend class FakeLoop;
  friend class FakeListener;
  friend class FakeUdpSocket;
  friend class FakeConnection;
  friend class FakeWatch;

  struct Event {
    std::weak_ptr<FakeLoop*> loop;
    std::function<void()> function;
  };

  void schedule(base::Nanos when, const std::shared_ptr<FakeLoop*>& loop, std::function<void()> function);
  void pollWatches();
  Endpoint freeEndpoint(const Endpoint& wanted, const std::vector<Endpoint>& used, const char* kind,
                        const std::string& option);
  FakeListener* listenerAt(const Endpoint& endpoint) const;
  FakeUdpSocket* udpSocketAt(const Endpoint& endpoint) const;

  base::Clock& clock_;
  std::map<std::pair<base::Nanos, std::uint64_t>, Event> queue_;
  std::uint64_t sequence_ = 0;
  std::uint64_t events_ = 0;
  std::uint64_t datagrams_ = 0;
  std::uint16_t nextPort_ = 40000;
  std::vector<FakeListener*> listeners_;
  std::vector<FakeUdpSocket*> udpSockets_;
  std::vector<std::weak_ptr<FakeConnection>> connections_;
  std::vector<std::weak_ptr<FakeWatch>> watches_;
};

}  // namespace hapticd::net

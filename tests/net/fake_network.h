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
class FakeDescriptor;

/// How bytes and datagrams travel; a change holds for what is sent or read afterwards.
struct FakeNetworkOptions {
  base::Nanos delay = 50'000;                         ///< one way
  bool otherMachines = false;                         ///< programs may be at any address
  std::size_t windowBytes = std::size_t{256} * 1024;  ///< sent but not yet read by the peer's program
  /// How many of the bytes that have arrived one read returns (clamped to 1 ... available); empty: up to 64
  /// KiB.
  std::function<std::size_t(std::size_t available)> readSize = {};
  /// Whether the datagram of this number (from 0, over all sockets) is lost; empty: none.
  std::function<bool(std::uint64_t number)> losesDatagram = {};
  /// Further delay of each piece of a stream, which stays in order, and of each datagram; empty: none.
  std::function<base::Nanos()> jitter = {};
  /// Calls around a read by the program at `local`, which had `total` bytes from `remote` before and now gets
  /// `size` more; the first when they arrived. Empty: nobody watches.
  std::function<void(const Endpoint& local, const Endpoint& remote, std::uint64_t total)> arrived = {};
  std::function<void(const Endpoint& local, const Endpoint& remote, std::size_t size)> reads = {};
  std::function<void(const Endpoint& local, const Endpoint& remote, std::uint64_t total)> hasRead = {};
  /// A listener tried to accept, and its program had no descriptor left; `pending` connections waited. Empty:
  /// nobody watches.
  std::function<void(const Endpoint& local, std::size_t pending)> refusedAccept = {};
};

class FakeNetwork : public Network {
 public:
  /// The clock is advanced by sleepUntil(); it outlives the network, which outlives its loops.
  explicit FakeNetwork(base::Clock& clock) : clock_(clock) {}

  std::unique_ptr<Loop::Impl> makeLoop() override;
  /// Numbers, "localhost" and what `hosts` names.
  std::uint32_t resolve(const std::string& host) override;
  std::uint32_t localAddressTowards(const std::string& host) override;

  FakeNetworkOptions options;
  std::map<std::string, std::uint32_t> hosts;
  std::uint32_t localUser = 1000;  ///< who connects to Unix sockets

  /// From now on nothing of this connection arrives, either way, as if the cable were cut.
  void cut(const Endpoint& oneEnd);
  /// A reset reaches both ends after the delay.
  void reset(const Endpoint& oneEnd);

  /// Sockets that the program of this loop has open, without its listeners. Loops are numbered from 0 in the
  /// order of their making.
  std::size_t sockets(std::size_t loop) const noexcept { return queues_[loop].sockets; }
  /// From now on this program gets EMFILE for a further socket when it has `most`; nothing: no limit. Those
  /// beyond the limit stay.
  void limitSockets(std::size_t loop, std::optional<std::size_t> most) { queues_[loop].most = most; }

  base::Nanos time() const noexcept { return clock_.now(); }
  /// When the next event is due; nothing when there is none. For simulators that have further sources of
  /// events.
  std::optional<base::Nanos> next();
  /// Advances the clock to the next event and handles it; false when none is due up to `limit`.
  virtual bool runNext(base::Nanos limit);
  /// Handled so far.
  std::uint64_t events() const noexcept { return events_; }

 protected:
  // For a simulator that decides which loop runs.
  std::size_t loops() const noexcept { return queues_.size(); }
  std::optional<base::Nanos> nextOf(std::size_t loop) const;
  /// Handles the next event of the loop, which must have one; the clock must have reached it.
  void runNextOf(std::size_t loop);
  void pollWatches();
  /// A function was posted to a loop, perhaps from another thread.
  virtual void posted() {}

 private:
  friend class FakeLoop;
  friend class FakeListener;
  friend class FakeUdpSocket;
  friend class FakeConnection;
  friend class FakeWatch;
  friend class FakeDescriptor;

  struct Event {
    base::Nanos when;
    std::uint64_t sequence;
    std::size_t function;

    bool operator>(const Event& other) const noexcept {
      return when != other.when ? when > other.when : sequence > other.sequence;
    }
  };

  struct Queue {
    FakeLoop* loop;             // null when it is gone
    std::vector<Event> events;  // a heap, the next event first
    std::vector<std::function<void()>> functions = {};
    std::vector<std::size_t> free = {};  // of the functions
    std::size_t sockets = 0;
    std::optional<std::size_t> most = {};
  };

  void schedule(base::Nanos when, std::size_t loop, std::function<void()> function);
  Endpoint freeEndpoint(const Endpoint& wanted, const std::vector<Endpoint>& used, const char* kind,
                        const std::string& option);
  FakeListener* listenerAt(const Endpoint& endpoint) const;
  FakeListener* listenerAt(const std::string& path) const;
  FakeUdpSocket* udpSocketAt(const Endpoint& endpoint) const;

  base::Clock& clock_;
  std::vector<Queue> queues_;  // by the number of the loop
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

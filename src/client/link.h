// One connection to one server that heals itself: dials, shakes hands, collects what is sent into big
// buffers, and queues what arrives for dispatch. Everything happens in the thread that calls it, none of it
// in a hidden one.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/reverse_connection.h"
#include "client/inbox.h"
#include "client/server_address.h"
#include "net/connection.h"
#include "net/loop.h"
#include "wire/peer.h"

namespace hapticd::client {

using Duration = std::chrono::nanoseconds;

/// Now, as messages are stamped.
wire::Time wireNow();
/// The stamp of a message as a point in time.
std::chrono::system_clock::time_point toTimePoint(wire::Time time);

struct LinkOptions {
  bool reconnect = true;
  std::chrono::milliseconds retry_interval{250};
  std::chrono::milliseconds send_timeout{10000};
  std::size_t queue_limit = 4 * 1024 * 1024;
  /// Take over names that the server describes and we did not know, as stock VRPN does.
  bool adopt_names = false;
};

/// Counts over all connections of a link.
struct LinkStatistics {
  std::uint64_t connections = 0;
  std::uint64_t messages_out = 0;
  std::uint64_t messages_in = 0;
  std::uint64_t messages_dropped = 0;
  std::uint64_t tcp_bytes_out = 0;
  std::uint64_t tcp_bytes_in = 0;
  std::uint64_t udp_bytes_out = 0;
  std::uint64_t udp_bytes_in = 0;
};

class Link {
 public:
  using Handler = std::function<void(const Arrival&)>;

  /// Resolves the host, which may block, and begins to connect. Throws ConnectError for an unknown host.
  Link(const ServerAddress& server, const LinkOptions& options);
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  /// A device name of ours; it is pinged each second until it is heard.
  wire::LocalSender addDevice(std::string_view name);
  /// Other names, known or new; std::invalid_argument and std::length_error as wire::LocalNames.
  wire::LocalSender addSender(std::string_view name) { return names_.addSender(name); }
  wire::LocalType addType(std::string_view name) { return names_.addType(name); }
  const wire::LocalNames& names() const noexcept { return names_; }

  /// Sends a message: collected, kept before the first connection, dropped while a later one is lost. Waits
  /// while the server is behind by more than the queue limit; throws ConnectionLost when it takes nothing for
  /// the send timeout, and ConnectError when too much waits for the first connection.
  template <wire::WireMessage M>
  void send(wire::Time time, wire::LocalSender sender, const M& message,
            wire::Reliability reliability = M::kInfo.reliability) {
    if (holding_) {
      held_.add(time, sender, message);
      ++statistics_.messages_out;
      return;
    }
    if (connected()) {
      endpoint_->send(time, sender, message, reliability);
    } else if (connections_ == 0) {
      backlog_.add(time, sender, message);
    } else {
      ++statistics_.messages_dropped;
      return;
    }
    sent(wire::kHeaderBytes + wire::padded(wire::payloadSize(message)));
  }
  /// The same for a message whose payload is bytes already.
  void sendRaw(wire::Time time, wire::LocalSender sender, wire::LocalType type, wire::ByteView payload,
               wire::Reliability reliability);
  /// Sends a message at once and reliably, whatever is held; false, and counted, without a connection.
  template <wire::WireMessage M>
  bool sendNow(wire::LocalSender sender, const M& message) {
    if (!connected()) {
      ++statistics_.messages_dropped;
      return false;
    }
    endpoint_->send(wireNow(), sender, message, wire::Reliability::kReliable);
    ++statistics_.messages_out;
    pushOut();
    return true;
  }
  /// From now on send() keeps its messages, until they are dropped or sent as one batch of the device. A
  /// batch of more than kMostBatchBytes is dropped, too: std::length_error.
  void hold() { holding_ = true; }
  bool holding() const noexcept { return holding_; }
  void dropHeld();
  void sendHeld(wire::LocalSender device);
  static constexpr std::size_t kMostBatchBytes = 256 * 1024 * 1024;
  /// Hands what waits to the system as far as it takes it now.
  void flush();
  /// Waits until no more than so many bytes wait. Throws ConnectionLost when they never go.
  void drainTo(std::size_t bytes);
  /// Called whenever a wait for the server has got bytes out; the caller resets it.
  std::function<void()> onDrainStep;

  /// Sends what waits, sleeps until something arrives or the timeout is over, hands all arrivals to the
  /// handler and returns how many there were; from inside a handler it hands over nothing.
  std::size_t poll(Duration timeout, const Handler& handler);

  // Both are called by the event loop and may not throw: on a new connection before anything is sent, and
  // with each message as it arrives, before it waits for poll().
  std::function<void()> onUp;
  std::function<void(wire::MessageKind, wire::LocalSender, wire::ByteView)> onArriving;
  /// Calls the function each period while somebody polls or waits.
  [[nodiscard]] net::Subscription every(Duration period, std::function<void()> function) {
    return loop_.every(period, std::move(function));
  }

  bool connected() const noexcept { return shaken() && connection_.isOpen(); }
  /// Sleeps until connected, or until the device is heard: false after the timeout.
  bool waitConnected(Duration timeout);
  bool waitHeard(wire::LocalSender device, Duration timeout);
  /// Sleeps and lets things arrive, without dispatching them, until the condition holds: false after the
  /// timeout.
  bool waitUntil(const std::function<bool()>& condition, Duration timeout);
  /// Whether anything came from the device on this connection.
  bool heard(wire::LocalSender device) const noexcept {
    return connected() && heard_[static_cast<std::size_t>(device.value)];
  }

  const ServerAddress& server() const noexcept { return server_; }
  /// Number of the connection, 0 before the first.
  std::uint64_t connectionNumber() const noexcept { return connections_; }
  /// Bytes given to this connection's TCP stream, and how many of them the system has taken.
  std::uint64_t streamBytes() const noexcept { return stream_bytes_; }
  std::uint64_t streamBytesTaken() const;
  /// Why there is no connection, with the remedy.
  std::string whyNotConnected() const;
  /// Device names that the server described by itself.
  std::vector<std::string> serverDevices() const;
  LinkStatistics statistics() const;

 private:
  static constexpr Duration kLongestWait = std::chrono::hours(24);  // a deadline must not overflow

  /// Whether hands were shaken, on a connection that may have failed meanwhile.
  bool shaken() const noexcept { return endpoint_ && endpoint_->connected(); }
  void attempt();
  void retryLater();
  void adopt(net::Connection connection);
  std::optional<wire::UdpAddress> openDatagrams(const net::Endpoint& local);
  template <class Id>
  void adoptName(std::string_view name, Id (wire::LocalNames::*add)(std::string_view));
  void received(wire::ByteView bytes);
  void receivedDatagram(wire::ByteView bytes, const net::Endpoint& from);
  void onEvent(const wire::Event& event);
  void onConnected();
  void onMessage(const wire::MessageReceived& message);
  void onUdpDescribed(const wire::UdpAddress& address);
  void onClosed(const std::string& reason);
  void addTraffic(LinkStatistics& statistics) const;
  void pingUnheard();
  void sent(std::size_t bytes);
  void pushOut();
  std::shared_ptr<net::Buffer> takeBuffer();
  std::size_t dispatch(const Handler& handler);

  ServerAddress server_;
  LinkOptions options_;
  net::Endpoint address_;
  net::Loop loop_;
  wire::LocalNames names_;
  wire::FrameEncoder backlog_;  // until the first connection
  wire::FrameEncoder held_;
  bool holding_ = false;
  Inbox inbox_;

  // Of the present attempt or connection.
  std::optional<ReverseConnection> call_back_;
  net::Connection connection_;
  std::optional<net::UdpSocket> udp_;
  std::optional<net::Endpoint> udp_peer_;
  std::optional<wire::Peer> endpoint_;
  net::Subscription handshake_timeout_;
  net::Subscription retry_;
  net::Subscription ping_;
  std::vector<std::string> server_devices_;
  std::uint64_t stream_bytes_ = 0;
  std::size_t uncounted_ = 0;  // bytes collected since the last pushOut()
  bool paused_ = false;

  std::vector<wire::LocalSender> devices_;
  std::vector<bool> heard_;  // by sender
  std::vector<std::shared_ptr<net::Buffer>> buffers_;
  std::string last_failure_;
  std::uint64_t connections_ = 0;
  LinkStatistics statistics_;
  bool dispatching_ = false;
};

/// Holds back what a link sends, until it is committed as one batch, or dropped if that never happens.
class HeldBatch {
 public:
  explicit HeldBatch(Link& link) : link_(link) { link_.hold(); }
  ~HeldBatch() {
    if (link_.holding()) link_.dropHeld();
  }
  HeldBatch(const HeldBatch&) = delete;
  HeldBatch& operator=(const HeldBatch&) = delete;
  void commit(wire::LocalSender device) { link_.sendHeld(device); }

 private:
  Link& link_;
};

}  // namespace hapticd::client

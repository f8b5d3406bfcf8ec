// A connection to one server that reconnects by itself: connects, performs the handshake, collects messages
// into large buffers, and queues arrivals for dispatch. Everything happens in the calling thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/host_lookup.h"
#include "client/inbox.h"
#include "client/reverse_connection.h"
#include "client/server_address.h"
#include "net/connection.h"
#include "net/loop.h"
#include "wire/peer.h"

namespace hapticd::client {

using Duration = std::chrono::nanoseconds;

/// Wall-clock time as messages carry it.
wire::Time wireNow();
/// The stamp of a message as a point in time.
std::chrono::system_clock::time_point toTimePoint(wire::Time time);
/// Wall-clock time as reports carry it.
std::chrono::system_clock::time_point wallTimePoint();

struct LinkOptions {
  bool reconnect = true;
  std::chrono::milliseconds retryInterval{250};
  std::chrono::milliseconds sendTimeout{10000};
  /// The same for what waits at the end of the link.
  std::chrono::milliseconds endSendTimeout = sendTimeout;
  std::size_t queueLimit_bytes = 4 * 1024 * 1024;
  /// Adopt unknown names that the server describes, as stock VRPN does.
  bool adoptNames = false;
};

/// Counts over all connections of a link.
struct LinkStatistics {
  std::uint64_t connections = 0;
  std::uint64_t messagesOut = 0;
  std::uint64_t messagesIn = 0;
  std::uint64_t messagesDropped = 0;
  std::uint64_t tcpBytesOut = 0;
  std::uint64_t tcpBytesIn = 0;
  std::uint64_t udpBytesOut = 0;
  std::uint64_t udpBytesIn = 0;
};

/// Thread: that of the caller, always the same one.
class Link {
 public:
  using Handler = std::function<void(const Arrival&)>;
  static constexpr std::chrono::hours kLongestWait{24};  ///< A deadline must not overflow.

  /// Resolves the host, which may block, and starts to connect; later attempts look it up anew, without
  /// blocking. Throws ConnectError for an unknown host.
  Link(const ServerAddress& server, const LinkOptions& options);
  /// Sends what is collected and waits until the server has received it and ended the connection; up to
  /// kEndTimeout for one that has received everything, and endSendTimeout while it receives nothing.
  ~Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;
  static constexpr std::chrono::milliseconds kEndTimeout{1000};

  /// Names a device to use; the link pings it every second until anything arrives from it on this connection.
  wire::LocalSender addDevice(std::string_view name);
  /// Other names, known or new. Throws std::invalid_argument and std::length_error as wire::LocalNames.
  wire::LocalSender addSender(std::string_view name) { return names_.addSender(name); }
  wire::LocalType addType(std::string_view name) { return names_.addType(name); }
  const wire::LocalNames& names() const noexcept { return names_; }

  /// Sends a message: it is collected, kept before the first connection, dropped while a later one is lost.
  /// Sleeps while more than the queue limit waits. Throws ConnectionLost when the server accepts no data for
  /// the send timeout, and ConnectError when more than the queue limit waits for the first connection.
  template <wire::WireMessage M>
  void send(wire::Time time, wire::LocalSender sender, const M& message,
            wire::Reliability reliability = M::kInfo.reliability) {
    if (holding_) {
      held_.add(time, sender, message);
      ++statistics_.messagesOut;
      return;
    }
    if (connected()) {
      peer_->send(time, sender, message, reliability);
    } else if (connections_ == 0) {
      needRoom();
      backlog_.add(time, sender, message);
    } else {
      ++statistics_.messagesDropped;
      return;
    }
    sent(wire::kHeaderBytes + wire::padded(wire::payloadSize(message)));
  }
  /// The same for an encoded payload.
  void sendRaw(wire::Time time, wire::LocalSender sender, wire::LocalType type, wire::ByteView payload,
               wire::Reliability reliability);
  /// Sends a message now, ahead of what is held, and reliably unless it says otherwise. Without a connection:
  /// counts it as dropped, returns false.
  template <wire::WireMessage M>
  bool sendNow(wire::LocalSender sender, const M& message,
               wire::Reliability reliability = wire::Reliability::kReliable) {
    if (!putBeforeHeld(sender, message, reliability)) return false;
    pushOut();
    return true;
  }
  /// The same, but leaves with the next one that is sent.
  template <wire::WireMessage M>
  bool putBeforeHeld(wire::LocalSender sender, const M& message,
                     wire::Reliability reliability = wire::Reliability::kReliable) {
    if (!connected()) {
      ++statistics_.messagesDropped;
      return false;
    }
    peer_->send(wireNow(), sender, message, reliability);
    ++statistics_.messagesOut;
    return true;
  }
  /// After sending: false when nobody receives it, because the server has ended the connection. The system
  /// takes the first bytes for a server that is gone, so only the socket tells. Then receives what came
  /// before the end.
  bool reachesServer();
  /// From now on send() keeps its messages until dropHeld() or sendHeld().
  void hold() { holding_ = true; }
  bool holding() const noexcept { return holding_; }
  void dropHeld();
  /// Sends what is held as one batch of the device. Drops it and throws std::length_error above
  /// kMaxBatchBytes.
  void sendHeld(wire::LocalSender device);
  static constexpr std::size_t kMaxBatchBytes = 256 * 1024 * 1024;
  /// Gives collected bytes to the system, as far as it accepts them without waiting.
  void flush();
  /// Sleeps until at most this many bytes wait. Throws ConnectionLost when the connection ends or accepts no
  /// data for the send timeout.
  void drainTo(std::size_t bytes);
  /// Bytes sent on this connection's stream that the server has not acknowledged: waiting here or in the
  /// system.
  std::size_t backlogBytes() const;
  /// Called whenever the system accepted bytes during a wait; the caller resets it.
  std::function<void()> onDrainStep;

  /// Sends what is collected, sleeps until something arrives or the timeout is over, passes all arrivals to
  /// the handler and returns their number. Called from a handler, it passes nothing.
  std::size_t poll(Duration timeout, const Handler& handler);

  // Called by the event loop; they must not throw.
  std::function<void()> onUp;  ///< on a new connection, before anything is sent
  /// With each message as it arrives, before it waits for poll(): kind, device and payload.
  std::function<void(wire::MessageKind, wire::LocalSender, wire::ByteView)> onArrival;
  /// Calls the function every period while the link polls or waits.
  [[nodiscard]] net::Subscription every(Duration period, std::function<void()> function) {
    return loop_.every(period, std::move(function));
  }

  bool connected() const noexcept { return handshakeDone() && connection_.isOpen(); }
  /// Sleeps until connected, or until something arrived from the device; false after the timeout.
  bool waitConnected(Duration timeout);
  bool waitHeard(wire::LocalSender device, Duration timeout);
  /// Sends and receives, without dispatching, until the condition holds; false after the timeout.
  bool waitUntil(const std::function<bool()>& condition, Duration timeout);
  /// Sends and receives once, without dispatching and without sleeping.
  void runOnce();
  /// Whether anything arrived from the device on this connection.
  bool heard(wire::LocalSender device) const noexcept {
    return connected() && heard_[static_cast<std::size_t>(device.value)];
  }

  const ServerAddress& server() const noexcept { return server_; }
  /// The same server by its resolved address, reached by one TCP connection.
  ServerAddress resolvedServer() const {
    return {address_.addressText(), server_.port, true, server_.socket};
  }
  /// Number of the connection, 0 before the first.
  std::uint64_t connectionNumber() const noexcept { return connections_; }
  /// Bytes given to this connection's TCP stream, and those of them that the system has accepted.
  std::uint64_t streamBytes() const noexcept { return streamBytes_; }
  std::uint64_t streamBytesTaken() const;
  /// The reason for which there is no connection, with the remedy.
  std::string whyNotConnected() const;
  /// Device names that the server described first.
  std::vector<std::string> serverDevices() const;
  LinkStatistics statistics() const;

 private:
  /// Whether the handshake is complete, on a connection that may have failed since.
  bool handshakeDone() const noexcept { return peer_ && peer_->connected(); }
  void attempt();
  /// The address by the last answer of the system, which is asked again for the next call.
  const net::Endpoint& renewedAddress();
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
  void needRoom() const;
  void sent(std::size_t bytes);
  void pushOut();
  std::shared_ptr<net::Buffer> takeBuffer();
  std::size_t dispatch(const Handler& handler);

  const int process_;
  ServerAddress server_;
  LinkOptions options_;
  std::optional<HostLookup> host_;  // none: a socket of this machine
  net::Endpoint address_;
  net::Loop loop_;
  wire::LocalNames names_;
  wire::FrameEncoder backlog_;  // commands before the first connection
  wire::FrameEncoder held_;
  bool holding_ = false;
  Inbox inbox_;

  // State of the present attempt or connection.
  std::optional<ReverseConnection> reverseConnection_;
  net::Connection connection_;
  std::optional<net::UdpSocket> udp_;
  std::optional<net::Endpoint> udpPeer_;
  std::optional<wire::Peer> peer_;
  net::Subscription handshakeTimer_;
  net::Subscription retryTimer_;
  net::Subscription pingTimer_;
  std::vector<std::string> serverDevices_;
  std::uint64_t streamBytes_ = 0;
  std::size_t uncounted_ = 0;  // bytes collected since the last pushOut()
  bool paused_ = false;
  bool announced_ = false;  // to the handler of poll()

  std::vector<wire::LocalSender> devices_;
  std::vector<bool> heard_;  // by sender
  std::vector<std::shared_ptr<net::Buffer>> buffers_;
  std::string lastFailure_;
  std::uint64_t connections_ = 0;
  LinkStatistics statistics_;
  bool dispatching_ = false;
};

/// Holds back what a link sends until commit() sends it as one batch; the destructor drops it otherwise.
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

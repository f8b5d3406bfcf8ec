// One client connection: its protocol state and the devices that it subscribed to.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "base/world.h"
#include "net/connection.h"
#include "net/udp_socket.h"
#include "scene/notice.h"
#include "server/session/client_status.h"
#include "server/session/heartbeat_watch.h"
#include "server/session/message_backlog.h"
#include "server/session/wall_clock.h"
#include "wire/peer.h"

namespace hapticd::server {

class Session;

/// How a client is connected.
enum class SessionMode { tcp, udp, web };
std::string_view nameOf(SessionMode mode);

/// Receives the events of a session. Net thread.
class SessionOwner {
 public:
  virtual ~SessionOwner() = default;
  /// The client subscribed to one of the server's device names.
  virtual void onSubscribed(Session& session, wire::LocalSender name) = 0;
  /// A message for one of the server's devices, read at `received` on the servo clock.
  virtual void onMessage(Session& session, const wire::MessageReceived& message, base::Nanos received) = 0;
  /// A warning for the log that a client can cause at any rate: throttle it.
  virtual void onWarning(const Session& session, const std::string& text) = 0;
  /// As onWarning(), for what is no fault of the client.
  virtual void onNote(const Session& session, const std::string& text) = 0;
  /// Called between slices of a long read, so that pending reports can be flushed.
  virtual void onReadSlice() = 0;
  /// All messages of one read were passed to onMessage().
  virtual void onReadEnd(Session& session) = 0;
  /// The client disconnected while the server does not read from it: end its forces now. Messages that it
  /// sent before are still passed on until onClosed().
  virtual void onPeerGone(Session& session, const std::string& reason) = 0;
  /// The connection is closed; the owner destroys the session.
  virtual void onClosed(Session& session, const std::string& reason) = 0;
};

/// A connected client. Lives in the net thread.
class Session {
 public:
  /// Without `udp` everything is sent by TCP. The socket must be bound already.
  Session(scene::ClientId id, SessionOwner& owner, const wire::LocalNames& names, const WallClock& clock,
          net::Connection connection, std::unique_ptr<net::UdpSocket> udp, SessionMode mode);

  /// Starts the handshake: sends the server's cookie and waits for the client's.
  void start();

  scene::ClientId id() const noexcept { return id_; }
  /// "127.0.0.1:40312, tcp" for logs.
  const std::string& description() const noexcept { return description_; }
  bool connected() const noexcept { return peer_.connected(); }

  /// Whether the client wants reports under this name: it described the name, or none of the server's names
  /// yet.
  bool wants(wire::LocalSender name) const noexcept;
  /// How many of the server's names the client has described so far.
  std::size_t namesWanted() const noexcept { return subscriptions_.size(); }
  /// The client's IPv4 address, without the port.
  std::string address() const { return connection_.remote().addressText(); }

  /// Queues one message; the next flush() sends it.
  template <wire::WireMessage M>
  void send(wire::LocalSender from, const M& message) {
    peer_.send(clock_.now(), from, message);
  }
  /// The same with a time stamp, and by TCP whatever its kind: a datagram may overtake the descriptions that
  /// the client needs to understand it.
  void sendReliably(wire::LocalSender from, const wire::Message& message, wire::Time time) {
    peer_.send(time, from, message, wire::Reliability::kReliable);
  }
  /// Queues frames that are shared with other clients. Low-latency frames are dropped first when this client
  /// reads too slowly.
  void sendShared(const std::shared_ptr<const net::Buffer>& frames, net::Delivery delivery);
  /// Sends everything queued with one system call.
  void flush();

  /// Logs a throttled warning about this client. Quote text from the client with wire::inQuotes().
  void logWarning(const std::string& text) { owner_.onWarning(*this, text); }

  /// Limit of the backlog, and so of the data that stop, heartbeat and ping can overtake.
  static constexpr std::size_t kReadAhead_bytes = 4U << 20;

  /// Holds back further messages because the scene is behind; only kinds with wire::overtakes() are still
  /// passed on. Beyond kReadAhead_bytes the session stops reading, and TCP flow control makes the client
  /// wait.
  void hold() { held_ = true; }
  /// Ends hold() and passes on the backlog in order: a slice of about 64 KiB, or less when the owner calls
  /// hold() again. Returns true when more is left: call again after other events were handled. After the last
  /// message of a client that has disconnected, onClosed() follows and the session is destroyed.
  bool release();
  /// Whether messages are held back.
  bool holding() const noexcept { return held_ || !backlog_.empty(); }
  /// Checks the client's heartbeats.
  HeartbeatWatch::Verdict checkHeartbeat(base::Nanos now) noexcept { return heartbeats_.check(now); }
  /// The server itself stood still until `now`: silence counts from here.
  void excuseStall(base::Nanos now) noexcept { heartbeats_.excuseStall(now); }
  /// Closes the connection; `reason` is for the log. onClosed() follows.
  void close(const std::string& reason);
  /// The same without flushing: the client may have stopped reading.
  void abort(const std::string& reason);
  /// Rejects the message being handled. In the stream this closes the session; in a datagram, which anybody
  /// at the client's address can forge, it only logs a warning.
  void refuse(const std::string& reason);

  /// State and traffic of the client. The caller fills in `commands` and `rate_Hz`.
  ClientStatus status() const;

 private:
  void onBytes(std::span<const std::byte> bytes);
  void onDatagram(std::span<const std::byte> bytes, const net::Endpoint& from);
  void onEvent(const wire::Event& event);
  void onReceived(const wire::MessageReceived& message);
  void onHeartbeat(const wire::MessageReceived& message, base::Nanos received);
  void deliver(const wire::MessageReceived& message, base::Nanos received);
  void pauseReading(bool pause);
  void onEnd(const std::string& reason);
  void onSender(std::string_view name);
  void onUdp(const wire::UdpAddress& address);
  void onLogRequest(const wire::LogRequest& request);
  void drainPeer();
  bool isStale(const wire::MessageReceived& message);

  scene::ClientId id_;
  SessionOwner& owner_;
  const wire::LocalNames& names_;
  const WallClock& clock_;
  net::Connection connection_;
  std::unique_ptr<net::UdpSocket> udp_;
  net::Endpoint datagramPeer_;
  wire::Peer peer_;
  SessionMode mode_;
  base::Nanos since_ = base::now();
  std::string description_;
  std::set<wire::LocalSender> subscriptions_;
  std::string failure_;
  bool inDatagram_ = false;
  bool held_ = false;
  bool reading_ = true;
  std::optional<std::string> closeReason_;  // set when the connection closed before the backlog was empty
  MessageBacklog backlog_;
  HeartbeatWatch heartbeats_;
  std::array<wire::Time, wire::kMessageKinds>
      lastReliable_{};  // newest reliable message of each kind, client's clock
};

}  // namespace hapticd::server

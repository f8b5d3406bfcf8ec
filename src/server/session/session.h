// One client: its connection, the protocol state on it, and which of our devices it listens to.
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
#include "server/session/heartbeat_watch.h"
#include "server/session/message_backlog.h"
#include "server/session/wall_clock.h"
#include "server/session/client_status.h"
#include "wire/peer.h"

namespace hapticd::server {

class Session;

/// How a client is connected.
enum class SessionMode { tcp, udp, web };
std::string_view nameOf(SessionMode mode);

/// What a session reports to the server. Called in the net thread.
class SessionOwner {
 public:
  virtual ~SessionOwner() = default;
  /// The client listens to one of our names from now on.
  virtual void onSubscribed(Session& session, wire::LocalSender name) = 0;
  /// A message for one of our devices that the server read at `received` on the servo clock.
  virtual void onMessage(Session& session, const wire::MessageReceived& message, base::Nanos received) = 0;
  /// Worth a line in the log, but a client can cause it as often as it likes.
  virtual void onRemark(const Session& session, const std::string& text) = 0;
  /// Called between slices of a long read, so that pending reports can be flushed.
  virtual void onReadSlice() = 0;
  /// All messages of one read were passed on.
  virtual void onReadEnd(Session& session) = 0;
  /// The client is gone while the server does not read from it: its forces must end now. What it sent before is still
  /// read, up to onClosed().
  virtual void onDeparted(Session& session, const std::string& reason) = 0;
  /// Over, with the reason; the owner destroys the session after this returns.
  virtual void onClosed(Session& session, const std::string& reason) = 0;
};

/// A connected client. Lives in the net thread.
class Session {
 public:
  /// Without `udp` everything goes by the connection. The socket must be bound already.
  Session(scene::ClientId id, SessionOwner& owner, const wire::LocalNames& names, const WallClock& clock,
          net::Connection connection, std::unique_ptr<net::UdpSocket> udp, SessionMode mode);

  /// Begins to talk: our cookie leaves, the client's is awaited.
  void start();

  scene::ClientId id() const noexcept { return id_; }
  /// "127.0.0.1:40312, tcp" for logs.
  const std::string& description() const noexcept { return description_; }
  bool connected() const noexcept { return peer_.connected(); }

  /// Whether reports under this name are wanted: those it described, or all while it has described none of
  /// ours.
  bool wants(wire::LocalSender name) const noexcept;
  /// How many of our names it has described so far.
  std::size_t namesWanted() const noexcept { return subscriptions_.size(); }
  /// Where the client is, without the port.
  std::string address() const { return connection_.remote().addressText(); }

  /// Queues one message; it leaves with the next flush().
  template <wire::WireMessage M>
  void send(wire::LocalSender from, const M& message) {
    peer_.send(clock_.now(), from, message);
  }
  /// The same with the time of what it tells, and by TCP whatever its kind: datagrams may overtake the names
  /// that they need.
  void sendReliably(wire::LocalSender from, const wire::Message& message, wire::Time time) {
    peer_.send(time, from, message, wire::Reliability::kReliable);
  }
  /// Queues frames that are shared with other clients; dropped first when this client reads too slowly if
  /// lowLatency.
  void sendShared(const std::shared_ptr<const net::Buffer>& frames, net::Delivery delivery);
  /// Writes what is queued: one system call.
  void flush();

  /// A line in the log about this client, unless there are too many. Quote what the client said.
  void remark(const std::string& text) { owner_.onRemark(*this, text); }

  /// Stops reading ahead of a held-back scene here: what stop, heartbeat and ping overtake at most.
  static constexpr std::size_t kReadAhead_bytes = 4U << 20;

  /// Holds back what the client sends from now on, because the scene is behind; only messages that overtake are still
  /// passed on. Beyond kReadAhead_bytes the session stops reading, and TCP makes the client wait.
  void hold() { held_ = true; }
  /// Ends hold() and passes on what was held back, in order: a slice of about 64 KiB, or less when the owner calls
  /// hold() again. True when more is left: call again, after giving others their turn. When it was the last of a client
  /// that has left, onClosed() follows and the session is destroyed.
  bool release();
  /// Whether messages are held back.
  bool holding() const noexcept { return held_ || !backlog_.empty(); }
  /// Judges the client's heartbeats.
  HeartbeatWatch::Verdict checkHeartbeat(base::Nanos now) noexcept { return heartbeats_.check(now); }
  /// Ends it, with a reason for the log; onClosed follows.
  void close(const std::string& reason);
  /// The same at once, without waiting for a peer that may not read any more.
  void abort(const std::string& reason);
  /// The message now being given is no good. In the stream this ends the session; in a datagram, which
  /// anybody at the client's address can forge, it is remarked and forgotten.
  void refuse(const std::string& reason);

  /// What the client is, and what went to and fro. Which device it commands, and how often it hears of it, is
  /// left to the caller.
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
  bool isOvertaken(const wire::MessageReceived& message);

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
  std::optional<std::string> ended_;  // the connection is over, the backlog is not
  MessageBacklog backlog_;
  HeartbeatWatch heartbeats_;
  std::array<wire::Time, wire::kMessageKinds> lastReliable_{};  // of each kind, by the client's clock
};

}  // namespace hapticd::server

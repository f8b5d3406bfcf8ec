// One client connection: its protocol state and the devices that it subscribed to.
#pragma once

#include <array>
#include <climits>
#include <cstdint>
#include <map>
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
#include "server/session/identity.h"
#include "server/session/message_backlog.h"
#include "server/session/wall_clock.h"
#include "wire/peer.h"

namespace hapticd::server {

class Session;

/// How a client is connected.
enum class SessionMode { tcp, udp, web, local };
std::string_view nameOf(SessionMode mode);

/// Receives the events of a session. Net thread.
class SessionOwner {
 public:
  virtual ~SessionOwner() = default;
  /// The handshake is done; the client has described nothing yet.
  virtual void onConnected(Session& session) = 0;
  /// The client has read all that was queued, after low-latency frames for it were dropped.
  virtual void onCaughtUp(Session& session) = 0;
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
  /// A heartbeat arrived after the client's forces were ended for want of one.
  virtual void onHeartbeatAgain(Session& session) = 0;
  /// The server begins to close the connection, which may take 2 s while the client does not read: end its
  /// forces now. Called at most once; after it only stops are passed on, until onClosed().
  virtual void onEnding(Session& session) = 0;
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
  /// It speaks VRPN.
  bool greeted() const noexcept { return greeted_; }
  bool connected() const noexcept { return peer_.connected(); }

  /// Whether the client wants reports under this name: it described the name, or none of the server's names
  /// yet.
  bool wants(wire::LocalSender name) const noexcept;
  /// How many of the server's devices the client has described so far.
  std::size_t namesWanted() const noexcept { return subscriptions_.size(); }
  /// For texts about the connection: a device that the client uses.
  wire::LocalSender nameOfTexts() const noexcept;
  const net::Endpoint& remote() const noexcept { return connection_.remote(); }
  /// The client's IPv4 address, without the port.
  std::string address() const { return connection_.remote().addressText(); }

  /// What counts as one address: on the Unix socket, a user.
  std::string source() const { return user_ ? "user " + std::to_string(*user_) : sourceOf(address()); }

  SessionMode mode() const noexcept { return mode_; }
  /// Most messages per second besides stops and those that fill meshes; beyond it the session ends.
  void setMostPerSecond(int count) noexcept { mostPerSecond_ = count; }
  /// Memory that waits for the client or for the server to handle what it sent, and that of the names which
  /// it described.
  std::size_t memory() const;
  /// Whether onEnding() was called.
  bool ending() const noexcept { return ending_; }
  /// Whether onPeerGone() was called: what is still passed on was sent by a client that is gone.
  bool peerGone() const noexcept { return peerGone_; }
  /// What the client may do; the owner sets it.
  const Identity& identity() const noexcept { return identity_; }
  Commander commander() const { return {id_, address(), identity_}; }
  void setIdentity(const Identity& identity) noexcept { identity_ = identity; }
  /// Key that the connections of one program share; 0: none.
  std::uint64_t key() const noexcept { return key_; }
  void setKey(std::uint64_t key) noexcept { key_ = key; }
  /// The connection was opened by a page in a browser.
  bool ofPage() const noexcept { return ofPage_; }
  void setOfPage() noexcept { ofPage_ = true; }
  /// A token that came before the greeting: nobody hears an answer so early.
  void setToken(std::string_view token) { token_ = token; }
  std::string takeToken() { return std::exchange(token_, {}); }
  /// For a Unix socket, the number of the client's user.
  const std::optional<std::uint32_t>& user() const noexcept { return user_; }

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
  /// Counts ticks that were not reported to this client because the server was behind.
  void countSkipped(std::uint64_t ticks) noexcept { skipped_ += ticks; }
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
  /// The devices whose re-arm the session has not passed on, because the server ended the connection. Whole
  /// in onClosed().
  const std::set<wire::LocalSender>& lostRearms() const noexcept { return lostRearms_; }
  /// Before the server ends: logs the messages that are still held back, and are not passed on any more.
  void reportLost();
  /// Checks the client's heartbeats.
  HeartbeatWatch::Verdict checkHeartbeat(base::Nanos now) noexcept { return heartbeats_.check(now); }
  /// Whether that has ended the client's forces: they act again after a heartbeat.
  bool forcesEnded() const noexcept { return heartbeats_.ended(); }
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
  void onDrained();
  void onEnd(const std::string& reason);
  void closed(const std::string& reason);
  void noteLost(const wire::MessageReceived& message);
  void peerIsGone(const std::string& reason);
  void onSender(std::string_view name);
  void onUdp(const wire::UdpAddress& address);
  void onLogRequest(const wire::LogRequest& request);
  void refuseLogs(wire::LocalSender from);
  void sendLastText(const std::string& reason);
  void drainPeer();
  void beginEnd();
  bool isStale(const wire::MessageReceived& message);
  bool isOneTooMany(wire::MessageKind kind, base::Nanos received);

  scene::ClientId id_;
  SessionOwner& owner_;
  const wire::LocalNames& names_;
  const WallClock& clock_;
  net::Connection connection_;
  std::unique_ptr<net::UdpSocket> udp_;
  net::Endpoint datagramPeer_;
  std::optional<std::uint16_t> datagramSource_;  // port of the first datagram that counted
  bool datagramCounts_ = false;                  // a message of the present one was taken
  std::uint64_t ignoredDatagrams_ = 0;
  wire::Peer peer_;
  SessionMode mode_;
  base::Nanos since_ = base::now();
  std::string description_;
  std::set<wire::LocalSender> subscriptions_;  // without "VRPN Control"
  std::uint64_t skipped_ = 0;
  std::uint64_t dropsSeen_ = 0;
  Identity identity_;
  std::uint64_t key_ = 0;
  bool ofPage_ = false;
  std::string token_;
  std::optional<std::uint32_t> user_;
  std::string failure_;
  int mostPerSecond_ = INT_MAX;
  int inThisSecond_ = 0;
  base::Nanos secondBegan_ = 0;
  bool ending_ = false;
  bool peerGone_ = false;
  bool greeted_ = false;
  bool logsRefused_ = false;  // the client has not been notified yet
  bool inDatagram_ = false;
  bool held_ = false;
  bool reading_ = true;
  std::optional<std::string> closeReason_;  // set when the connection closed before the backlog was empty
  MessageBacklog backlog_;
  std::set<wire::LocalSender> lostRearms_;
  std::map<wire::MessageKind, std::uint64_t> lost_;  // not passed on, besides those that act for a moment
  HeartbeatWatch heartbeats_;
  std::array<wire::Time, wire::kMessageKinds>
      lastReliable_{};  // newest reliable message of each kind, client's clock
};

/// The clients of a server; those that came first come first.
using Sessions = std::map<scene::ClientId, std::unique_ptr<Session>>;

}  // namespace hapticd::server

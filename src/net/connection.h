// One TCP connection: bytes in by callback, shared immutable buffers out, bounded in memory and in time.
//
// Callbacks come only from the Loop, never from inside a call to the connection, so a caller may walk a
// container of connections and send to each. A callback may destroy its connection. Sending is in two steps:
// send() queues, flush() hands everything queued to the system in one call (64 buffers at a time).
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "net/endpoint.h"
#include "net/loop.h"
#include "net/send_queue.h"

namespace hapticd::net {

/// The bounds of a connection. With zero timeouts a lost peer is noticed only when the system gives up, after
/// about 15 minutes.
struct ConnectionOptions {
  /// Queued bytes above which low-latency buffers are dropped.
  std::size_t lowMarkBytes = std::size_t{256} * 1024;
  /// Queued reliable bytes above which the connection ends: its peer does not read.
  std::size_t hardLimitBytes = std::size_t{8} * 1024 * 1024;
  /// Bytes that the system may hold for the peer without having sent them; 0: no limit. With a limit, a new
  /// low-latency buffer replaces those that wait while the system takes no more, so that a slow reader gets
  /// the newest ones.
  int unsentLimitBytes = 0;
  /// Time without an acknowledgement that is due, after which the peer counts as lost. A peer whose program
  /// stops reading still acknowledges, so it is not lost.
  std::chrono::milliseconds lossTimeout{0};
  /// Silence after which, and interval at which, an idle peer is probed (TCP keep-alive).
  std::chrono::seconds keepAlive{0};
  /// How long close() waits for the peer to take what is queued.
  std::chrono::milliseconds closeTimeout{2000};
  /// Size of the system's send buffer (SO_SNDBUF), 0: automatic.
  int sendBufferBytes = 0;
};

/// Callbacks of a connection; any may be empty.
struct ConnectionHandlers {
  /// An outgoing connection is established.
  std::function<void()> onConnected = {};
  /// Bytes received (up to 256 KiB, valid during the call only). An exception ends the connection.
  std::function<void(std::span<const std::byte>)> onBytes = {};
  /// The queue is empty again after the system had not accepted all of it.
  std::function<void()> onDrained = {};
  /// While reading is paused: the peer has ended, reset or lost the connection, perhaps behind bytes that
  /// wait to be read. Called at most once, within 50 ms of the event's arrival. The connection stays: abort()
  /// it, or resumeReading() to read the rest up to onClosed. An end that the peer sent behind more bytes than
  /// the system takes while nobody reads (about 3 MiB) arrives only after reading.
  std::function<void(const std::string& reason)> onPeerGone = {};
  /// The peer has ended its direction, behind all that onBytes had. With this callback the connection stays
  /// for what is still to be sent, until close() or abort(); without it, it ends. Of plain connections only.
  std::function<void()> onPeerEnded = {};
  /// The connection has ended: called once, whichever side ended it, with the reason. No callback follows.
  std::function<void(const std::string&)> onClosed = {};
};

/// Counts since the start of the connection, and the current queues.
struct ConnectionStatistics {
  std::uint64_t bytesIn = 0;
  std::uint64_t bytesOut = 0;        ///< handed to the system
  std::uint64_t droppedBuffers = 0;  ///< low-latency buffers dropped because the peer is slow
  std::uint64_t droppedBytes = 0;
  std::size_t queuedBytes = 0;          ///< waiting here
  std::size_t unacknowledgedBytes = 0;  ///< with the system, not yet acknowledged by the peer (SIOCOUTQ)
};

/// Owns a TCP connection; destroying it closes it at once, without callbacks. A default-constructed or
/// moved-from one is empty: only isOpen(), the conversion to bool, assignment and destruction are allowed.
class Connection {
 public:
  class Impl;

  Connection() noexcept = default;
  explicit Connection(std::shared_ptr<Impl> impl) noexcept;
  Connection(Connection&& other) noexcept = default;
  Connection& operator=(Connection&& other) noexcept;
  ~Connection();

  /// Starts to connect and returns at once; onConnected or onClosed ("cannot connect to ...") follows. Sends
  /// are queued until then.
  [[nodiscard]] static Connection connect(Loop& loop, const Endpoint& peer, std::chrono::milliseconds timeout,
                                          const ConnectionOptions& options = {});

  /// Sets the callbacks and starts reading.
  void start(ConnectionHandlers handlers);

  explicit operator bool() const noexcept { return impl_ != nullptr; }
  /// Whether sent bytes may still reach the peer (also while connecting).
  bool isOpen() const noexcept;

  /// Queues a buffer that may be shared with other connections; ignored when not open. Ends the connection
  /// when the reliable bytes that the system does not take at once exceed the hard limit.
  void send(std::shared_ptr<const Buffer> buffer, Delivery delivery = Delivery::reliable);
  /// Queues a copy of the bytes.
  void send(std::span<const std::byte> bytes, Delivery delivery = Delivery::reliable);
  /// Writes the queue now; the rest follows by itself when the peer reads.
  void flush();

  /// Ends the connection after the queue has been sent, within closeTimeout; received bytes are ignored.
  void close(std::string reason);
  /// Ends the connection at once by a reset; the queue is lost.
  void abort(std::string reason);

  /// Stops reading, so that TCP holds the peer back. The end of the peer is reported by onPeerGone; onClosed
  /// follows only after resumeReading() and after all that the peer sent, although isOpen() may be false
  /// before.
  void pauseReading();
  /// Resumes reading.
  void resumeReading();

  /// Changes lossTimeout and keepAlive of ConnectionOptions.
  void setLossDetection(std::chrono::milliseconds lossTimeout, std::chrono::seconds keepAlive);

  /// Both addresses; valid after the end of the connection, too.
  const Endpoint& local() const noexcept;
  const Endpoint& remote() const noexcept;
  ConnectionStatistics statistics() const;
  /// As in statistics(), without asking the system: cheap for very many connections.
  std::size_t queuedBytes() const;
  /// The socket, for options that this class does not cover; -1 when closed or simulated.
  int nativeHandle() const noexcept;
  /// The system's number of the user that holds the other end of a Unix socket; nothing for all other
  /// connections and closed ones.
  std::optional<std::uint32_t> peerUser() const noexcept;

 private:
  std::shared_ptr<Impl> impl_;
};

}  // namespace hapticd::net

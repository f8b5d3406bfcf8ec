#include "net/tcp_connection.h"

#include <array>

#include "base/world.h"
#include "net/socket_options.h"
//
#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>

namespace hapticd::net {

namespace asio = boost::asio;
using asio::ip::tcp;

namespace {

// Beyond it, writing takes long enough for others to have their turn in between.
constexpr std::size_t kTurn_bytes = 64 * 1024;

constexpr char kClosed[] = "closed by the peer";
constexpr char kReset[] = "connection reset by the peer";

std::string endText(const boost::system::error_code& error) {
  if (error == asio::error::connection_reset || error == asio::error::broken_pipe) {
    return kReset;
  }
  if (error == asio::error::timed_out) {
    return "the peer is lost: it acknowledged nothing in time";
  }
  return "connection failed: " + error.message();
}

}  // namespace

TcpConnection::TcpConnection(AsioLoop& loop, const ConnectionOptions& options)
    : loop_(loop),
      options_(options),
      socket_(loop.context),
      timer_(loop.context),
      peerCheckTimer_(loop.context),
      queue_(options.lowMarkBytes) {}

void TcpConnection::connect(const Endpoint& peer, std::chrono::milliseconds timeout) {
  remote_ = peer;
  ErrorCode error;
  socket_.open(tcp::v4(), error);
  if (error) {
    finish("cannot connect to " + peer.text() + ": " + error.message());
    return;
  }
  armTimer(timeout, "cannot connect to " + peer.text() + ": no answer within " +
                        std::to_string(timeout.count()) + " ms");
  socket_.async_connect(toAsio<tcp::endpoint>(peer), [this, self = shared_from_this()](ErrorCode result) {
    if (state_ != State::connecting) {
      return;
    }
    if (result) {
      finish("cannot connect to " + remote_.text() + ": " + result.message());
      return;
    }
    timer_.cancel();
    becomeOpen();
    call(&ConnectionHandlers::onConnected);
    flush();
    armRead();
  });
}

void TcpConnection::adopt(Socket socket, const Endpoint& remote) {
  socket_ = std::move(socket);
  remote_ = remote;
  becomeOpen();
}

void TcpConnection::adoptLocal(int fd) {
  Socket socket(loop_.context);
  ErrorCode ignored;                      // the next call on the socket fails, too
  socket.assign(tcp::v4(), fd, ignored);  // Asio does not look at the kind
  adoptLocal(std::move(socket));
}

void TcpConnection::adoptLocal(Socket socket) {
  socket_ = std::move(socket);
  local_ = remote_ = {kLoopbackAddress, 0};
  state_ = State::open;
  setCloseOnExec(socket_.native_handle());
  ErrorCode error;
  socket_.non_blocking(true, error);
  if (error) finish("cannot watch the connection: " + error.message());
}

void TcpConnection::becomeOpen() {
  state_ = State::open;
  ErrorCode error;
  socket_.non_blocking(true, error);
  local_ = fromAsio(socket_.local_endpoint(error));
  const tcp::endpoint remote = socket_.remote_endpoint(error);
  if (!error) {  // the socket of a peer that is gone already knows none; the first read reports its end
    remote_ = fromAsio(remote);
  }
  applyOptions();
}

void TcpConnection::applyOptions() {
  const int fd = socket_.native_handle();
  setCloseOnExec(fd);
  setNoDelay(fd);
  if (options_.sendBufferBytes > 0) {
    setSendBuffer(fd, options_.sendBufferBytes);
  }
  if (options_.unsentLimitBytes > 0) {
    setUnsentLimit(fd, options_.unsentLimitBytes);
  }
  setKeepAlive(fd, options_.keepAlive);
  armWatch();
}

void TcpConnection::setLossDetection(std::chrono::milliseconds lossTimeout, std::chrono::seconds keepAlive) {
  options_.lossTimeout = lossTimeout;
  options_.keepAlive = keepAlive;
  watch_ = LossWatch(lossTimeout);
  if (state_ == State::open) {  // otherwise becomeOpen() applies it, or it is too late
    setKeepAlive(socket_.native_handle(), keepAlive);
    armWatch();
  }
}

void TcpConnection::armWatch() {
  ++watchSeries_;
  if (watch_.active()) {
    loop_.lossChecks.add(weak_from_this(), watchSeries_, watch_.interval());
  }
}

std::optional<std::chrono::milliseconds> TcpConnection::checkLoss(std::uint32_t series) {
  if (series != watchSeries_ || state_ != State::open || !failure_.empty()) {
    return std::nullopt;
  }
  const auto link = linkState(socket_.native_handle());
  if (link && watch_.isLost(*link, base::now())) {
    writeFailed(asio::error::timed_out);
    return std::nullopt;
  }
  return watch_.interval();
}

void TcpConnection::start(ConnectionHandlers handlers) {
  handlers_ = std::make_shared<ConnectionHandlers>(std::move(handlers));
  if (state_ == State::closed) {
    asio::post(loop_.context, [self = shared_from_this()] { self->notifyClosed(); });
  }
  armRead();
}

template <class Callback, class... Arguments>
void TcpConnection::call(Callback ConnectionHandlers::*callback, const Arguments&... arguments) {
  const auto handlers = handlers_;
  if (!handlers || !((*handlers).*callback)) {
    return;
  }
  if (auto error = errorOf([&] { ((*handlers).*callback)(arguments...); })) {
    finish("error while handling the connection: " + *error);
  }
}

// --- reading

void TcpConnection::armRead() {
  const bool wanted =
      state_ == State::open ? handlers_ && !paused_ : state_ == State::flushing || state_ == State::draining;
  if (state_ == State::open && paused_) {
    armPeerCheck();
  }
  if (readArmed_ || peerEnded_ || !wanted) {
    return;
  }
  readArmed_ = true;
  const auto read = [this, self = shared_from_this()] {
    readArmed_ = false;
    if (state_ != State::closed && !(state_ == State::open && paused_)) {
      readable();
    }
  };
  if (busy_) {
    loop_.post(read);  // in turn with the other busy ones, so that a short message of another need not wait
  } else {
    socket_.async_wait(Socket::wait_read, [read](const ErrorCode&) { read(); });
  }
}

// One read per wake-up, so that a fast sender does not starve the others.
void TcpConnection::readable() {
  ErrorCode error;
  const std::size_t share = loop_.readShare();
  const std::size_t size = socket_.read_some(asio::buffer(loop_.readBuffer.get(), share), error);
  setBusy(!error && size == share);
  if (!error) {
    deliver(size);
  } else if (error == asio::error::eof) {
    peerEnded();
  } else if (error != asio::error::would_block && error != asio::error::interrupted) {
    finish(failure_.empty() ? endText(error) : failure_);
  }
  armRead();
}

void TcpConnection::setBusy(bool busy) noexcept {
  if (busy != busy_) {
    loop_.busyReaders += busy ? 1 : -1;
  }
  busy_ = busy;
}

void TcpConnection::deliver(std::size_t bytes) {
  bytesIn_ += bytes;
  if (state_ == State::open) {
    call(&ConnectionHandlers::onBytes, std::span<const std::byte>(loop_.readBuffer.get(), bytes));
  }
}

void TcpConnection::peerEnded() {
  peerEnded_ = true;
  if (state_ == State::flushing) {
    return;  // the peer may have closed only its own direction: send it the rest
  }
  if (state_ == State::open && failure_.empty() && handlers_ && handlers_->onPeerEnded) {
    call(&ConnectionHandlers::onPeerEnded);
    return;
  }
  if (state_ == State::open) {
    flush();  // the answers to its last bytes
  }
  finish(failure_.empty() ? kClosed : failure_);
}

// --- writing

void TcpConnection::send(std::shared_ptr<const Buffer> buffer, Delivery delivery) {
  if (!sendable()) {
    return;
  }
  queue_.push(std::move(buffer), delivery, writeArmed_ && options_.unsentLimitBytes > 0);
  if (queue_.cost() <= options_.hardLimitBytes) {
    return;
  }
  flush();
  if (sendable() && queue_.cost() > options_.hardLimitBytes) {
    abort("the peer does not read: " + std::to_string(queue_.cost()) + " bytes wait for it, the limit is " +
          std::to_string(options_.hardLimitBytes));
  }
}

void TcpConnection::flush() {
  if ((state_ == State::open || state_ == State::flushing) && !writeArmed_ && !queue_.empty()) {
    write();
  }
}

void TcpConnection::write() {
  constexpr std::size_t kMostParts = 64;  // what Asio hands to one system call
  const bool wasBlocked = writeArmed_;
  writeArmed_ = false;
  while (!queue_.empty()) {
    std::array<std::span<const std::byte>, kMostParts> parts;
    std::array<asio::const_buffer, kMostParts> buffers;
    const std::size_t count = queue_.gather(parts);
    std::size_t offered = 0;
    for (std::size_t i = 0; i < count; ++i) {
      buffers[i] = asio::const_buffer(parts[i].data(), parts[i].size());
      offered += parts[i].size();
    }
    ErrorCode error;
    // One part is a shorter way into the kernel than a list of one.
    const std::size_t sent = count == 1 ? socket_.write_some(buffers[0], error)
                                        : socket_.write_some(std::span(buffers.data(), count), error);
    if (error && error != asio::error::would_block && error != asio::error::interrupted) {
      writeFailed(error);
      return;
    }
    bytesOut_ += sent;
    queue_.consume(sent);
    if (sent < offered) {
      armWrite();
      return;
    }
  }
  queueEmptied(wasBlocked);
}

void TcpConnection::armWrite() {
  writeArmed_ = true;
  const auto writeOn = [this, self = shared_from_this()] {
    if (state_ == State::open || state_ == State::flushing) {
      write();
    }
  };
  socket_.async_wait(Socket::wait_write, [this, writeOn](const ErrorCode&) {
    if (queue_.bytes() > kTurn_bytes) {
      loop_.post(writeOn);  // in turn with other large answers
    } else {
      writeOn();
    }
  });
}

void TcpConnection::queueEmptied(bool wasBlocked) {
  if (state_ == State::flushing) {
    ErrorCode error;
    socket_.shutdown(Socket::shutdown_send, error);
    if (error || peerEnded_) {
      finish(reason_);
      return;
    }
    // Closing now could reset the connection before the peer has read everything: wait for its end.
    state_ = State::draining;
  } else if (wasBlocked) {
    call(&ConnectionHandlers::onDrained);
  }
}

// A peer that sent a lot and left without reading its reports resets the connection, but its bytes can still
// be read. The reader reaches the end by itself.
void TcpConnection::writeFailed(const ErrorCode& error) {
  if (state_ != State::open) {
    finish(reason_);
    return;
  }
  if (peerEnded_) {
    finish(endText(error));
    return;
  }
  failure_ = endText(error);
  queue_.clear();
  ErrorCode ignored;
  socket_.shutdown(Socket::shutdown_both, ignored);
  armRead();
}

// --- the end

void TcpConnection::close(std::string reason) {
  if (!sendable() || state_ == State::connecting) {  // nothing can be waited for
    if (state_ == State::connecting || state_ == State::open) {
      finish(std::move(reason));
    }
    return;
  }
  reason_ = std::move(reason);
  state_ = State::flushing;
  armTimer(options_.closeTimeout, reason_);
  if (queue_.empty()) {
    queueEmptied(false);
  } else {
    flush();
  }
  armRead();
}

void TcpConnection::abort(std::string reason) {
  if (socket_.is_open()) {
    ErrorCode ignored;
    socket_.set_option(Socket::linger(true, 0), ignored);
  }
  finish(std::move(reason));
}

// An expired timer can no longer be cancelled: the one of connect() must not end the new connection.
void TcpConnection::armTimer(std::chrono::milliseconds timeout, std::string reason) {
  const bool whileConnecting = state_ == State::connecting;
  timer_.expires_after(timeout);
  timer_.async_wait([=, this, self = shared_from_this(), text = std::move(reason)](const ErrorCode& error) {
    if (!error && (!whileConnecting || state_ == State::connecting)) {
      finish(text);
    }
  });
}

// Posts the callback, so that no owner is called back from inside its own send() or flush().
void TcpConnection::finish(std::string reason) {
  if (state_ == State::closed) {
    return;
  }
  reason_ = state_ == State::flushing || state_ == State::draining ? reason_ : std::move(reason);
  state_ = State::closed;
  setBusy(false);
  queue_.clear();
  timer_.cancel();
  peerCheckTimer_.cancel();
  ErrorCode ignored;
  socket_.close(ignored);
  asio::post(loop_.context, [self = shared_from_this()] { self->notifyClosed(); });
}

void TcpConnection::notifyClosed() {
  if (const auto handlers = std::move(handlers_); handlers && handlers->onClosed) {
    loop_.guard([&] { handlers->onClosed(reason_); });
  }
}

void TcpConnection::release() noexcept {
  handlers_.reset();
  loop_.guard([this] {
    state_ = State::closed;
    setBusy(false);
    queue_.clear();
    timer_.cancel();
    peerCheckTimer_.cancel();
    ErrorCode ignored;
    socket_.close(ignored);
  });
}

void TcpConnection::setPaused(bool paused) {
  paused_ = paused;
  if (paused) {
    setBusy(false);
  }
  armRead();
}

// A wait for readability would end at once because of the unread bytes, and Asio does not ask for EPOLLRDHUP.
void TcpConnection::armPeerCheck() {
  constexpr std::chrono::milliseconds kInterval{20};
  if (peerCheckArmed_ || peerGoneReported_ || !handlers_ || !handlers_->onPeerGone) {
    return;
  }
  if (!failure_.empty()) {
    reportPeerGone(failure_);
    return;
  }
  if (!std::exchange(receiveBufferWide_, true)) {
    widenReceiveBuffer(socket_.native_handle());
  }
  peerCheckArmed_ = true;
  peerCheckTimer_.expires_after(kInterval);
  peerCheckTimer_.async_wait([this, self = shared_from_this()](const ErrorCode&) {
    peerCheckArmed_ = false;
    if (!paused_ || state_ != State::open) {
      return;
    }
    const PeerEnd end = peerEnd(socket_.native_handle());
    if (end == PeerEnd::none || !failure_.empty()) {
      armPeerCheck();
    } else {
      reportPeerGone(end == PeerEnd::reset ? kReset : kClosed);
    }
  });
}

// Posted for the same reason as finish().
void TcpConnection::reportPeerGone(std::string reason) {
  if (std::exchange(peerGoneReported_, true)) {
    return;
  }
  asio::post(loop_.context, [this, self = shared_from_this(), reason = std::move(reason)] {
    if (state_ != State::closed) {
      call(&ConnectionHandlers::onPeerGone, reason);
    }
  });
}

ConnectionStatistics TcpConnection::statistics() {
  return {bytesIn_,
          bytesOut_,
          queue_.droppedBuffers(),
          queue_.droppedBytes(),
          queue_.bytes(),
          socket_.is_open() ? net::unacknowledgedBytes(socket_.native_handle()) : 0};
}

}  // namespace hapticd::net

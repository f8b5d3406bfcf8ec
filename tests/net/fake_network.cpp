#include "net/fake_network.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <deque>
#include <functional>
#include <limits>
#include <stdexcept>
#include <system_error>

#include "net/acceptor.h"

namespace hapticd::net {

using base::Nanos;
using std::chrono::milliseconds;

namespace {

constexpr char kClosed[] = "closed by the peer";
constexpr char kReset[] = "connection reset by the peer";
constexpr char kLostPeer[] = "the peer is lost: it acknowledged nothing in time";

Nanos nanos(std::chrono::nanoseconds duration) {
  return duration.count();
}

bool matches(const Endpoint& bound, const Endpoint& wanted) {
  return bound.port == wanted.port && (bound.address == wanted.address || bound.address == kAnyAddress);
}

}  // namespace

// --- loops

class FakeLoop final : public Loop::Impl {
 public:
  explicit FakeLoop(FakeNetwork& network) : network_(network), number_(network.queues_.size()) {
    network.queues_.push_back({.loop = this, .events = {}});
  }
  // What the events hold may send as it goes.
  ~FakeLoop() override {
    network_.queues_[number_].loop = nullptr;
    network_.queues_[number_].events.clear();
    const auto functions = std::exchange(network_.queues_[number_].functions, {});
  }

  void run() override {
    const RunScope scope(*this);
    while (!std::exchange(stopped_, false)) {
      if (!network_.runNext(std::numeric_limits<Nanos>::max())) {
        throw std::logic_error("a simulated loop runs, and no event will ever come");
      }
    }
  }

  void runFor(Loop::Duration duration) override {
    const RunScope scope(*this);
    const Nanos end = network_.time() + nanos(duration);
    while (!stopped_ && network_.runNext(end)) {
    }
    if (!std::exchange(stopped_, false)) network_.clock_.sleepUntil(end);
  }

  std::size_t runOnce(Loop::Duration timeout) override {
    constexpr std::size_t kMostEvents = 1024;
    const RunScope scope(*this);
    const std::size_t before = handled_;
    const Nanos end = network_.time() + nanos(timeout);
    while (!stopped_ && handled_ - before < kMostEvents &&
           network_.runNext(handled_ > before ? network_.time() : end)) {
    }
    if (!std::exchange(stopped_, false) && handled_ == before) network_.clock_.sleepUntil(end);
    return handled_ - before;
  }

  void stop() override { stopped_ = true; }

  void post(std::function<void()> function) override {
    at(network_.time(), std::move(function));
    network_.posted();
  }

  std::shared_ptr<Subscription::State> after(Loop::Duration delay, std::function<void()> function) override;
  std::shared_ptr<Subscription::State> every(Loop::Duration period, std::function<void()> function) override;
  std::shared_ptr<Subscription::State> watchFd(int fd, std::function<void()> function) override;
  std::shared_ptr<Connection::Impl> connect(const Endpoint& peer, milliseconds timeout,
                                            const ConnectionOptions& options) override;
  std::shared_ptr<TcpListener::Impl> listen(const Endpoint& local, std::function<void(Connection)> onAccept,
                                            const ConnectionOptions& options, const char* option) override;
  std::shared_ptr<UdpSocket::Impl> bind(const Endpoint& local) override;
  std::shared_ptr<TcpListener::Impl> listenLocal(const std::filesystem::path& path,
                                                 std::function<void(Connection)> onAccept,
                                                 const ConnectionOptions& options) override;
  std::shared_ptr<Connection::Impl> connectLocal(const std::filesystem::path& path,
                                                 const ConnectionOptions& options) override;

  void at(Nanos when, std::function<void()> function) {
    network_.schedule(when, number_, std::move(function));
  }
  void handle(const std::function<void()>& function) {
    ++handled_;
    guard(function);
  }
  /// After the delay of the network.
  void arriving(std::function<void()> function) {
    at(network_.time() + network_.options.delay, std::move(function));
  }
  FakeNetwork& network() { return network_; }
  std::size_t number() const { return number_; }

 private:
  FakeNetwork& network_;
  const std::size_t number_;
  bool stopped_ = false;
  std::size_t handled_ = 0;
};

// That of a socket, from open() or accept() to close().
class FakeDescriptor {
 public:
  static bool available(const FakeLoop& loop, const FakeNetwork& network) {
    const auto& program = network.queues_[loop.number()];
    return !program.most || program.sockets < *program.most;
  }
  /// 0 or EMFILE.
  int open(FakeLoop& loop) {
    if (!available(loop, loop.network())) return EMFILE;
    network_ = &loop.network();
    number_ = loop.number();
    ++network_->queues_[number_].sockets;
    return 0;
  }
  void close() noexcept {
    if (network_ != nullptr) --network_->queues_[number_].sockets;
    network_ = nullptr;
  }

 private:
  FakeNetwork* network_ = nullptr;
  std::size_t number_ = 0;
};

namespace {

class FakeTimer final : public Subscription::State {
 public:
  FakeTimer(FakeLoop& loop, std::function<void()> function, Nanos period)
      : State(loop, std::move(function)), fakeLoop_(loop), period_(period) {}

  void startAt(Nanos when) {
    expiry_ = when;
    fakeLoop_.at(when, [this, self = shared_from_this()] { expired(); });
  }

 private:
  void expired() {
    if (!active_) return;
    if (period_ > 0) {
      const Nanos now = fakeLoop_.network().time();
      startAt(expiry_ + period_ > now ? expiry_ + period_ : now + period_);
    } else {
      active_ = false;
    }
    call();
  }

  FakeLoop& fakeLoop_;
  const Nanos period_;
  Nanos expiry_ = 0;
};

}  // namespace

class FakeWatch final : public Subscription::State {
 public:
  FakeWatch(FakeLoop& loop, std::function<void()> function, int fd)
      : State(loop, std::move(function)), fakeLoop_(loop), fd_(::fcntl(fd, F_DUPFD_CLOEXEC, 0)) {
    if (fd_ < 0) {
      throw Error("cannot watch file descriptor " + std::to_string(fd) + ": " +
                  std::system_category().message(errno));
    }
  }
  ~FakeWatch() override { ::close(fd_); }

  void poll(Nanos now) {
    pollfd request{fd_, POLLIN, 0};
    if (!active_ || pending_ || ::poll(&request, 1, 0) <= 0) return;
    pending_ = true;
    fakeLoop_.at(now, [this, self = shared_from_this()] {
      pending_ = false;
      if (active_) call();
    });
  }

 private:
  FakeLoop& fakeLoop_;
  const int fd_;
  bool pending_ = false;
};

// --- connections

// The states and their changes are those of TcpConnection; the wire is a few lines in write() and arrive().
class FakeConnection final : public Connection::Impl, public std::enable_shared_from_this<FakeConnection> {
 public:
  FakeConnection(FakeLoop& loop, const ConnectionOptions& options, const Endpoint& local,
                 const Endpoint& remote)
      : loop_(loop),
        network_(loop.network()),
        options_(options),
        queue_(options.lowMarkBytes),
        local_(local),
        remote_(remote) {}

  /// 0 or EMFILE.
  int openDescriptor() { return descriptor_.open(loop_); }

  void connect(milliseconds timeout) {
    const std::string what = "cannot connect to " + remote_.text() + ": ";
    if (const int error = openDescriptor(); error != 0)
      return finish(what + std::system_category().message(error));
    armTimer(timeout, what + "no answer within " + std::to_string(timeout.count()) + " ms");
    const auto self = shared_from_this();
    FakeListener* const listener = network_.listenerAt(remote_);
    if (listener == nullptr) {
      loop_.arriving([self, what] {
        if (self->state_ == State::connecting) self->finish(what + "Connection refused");
      });
      return;
    }
    announce();
  }

  void establish(const std::shared_ptr<FakeConnection>& other) {
    other_ = other;
    if (state_ == State::closed) return;
    state_ = State::open;
  }

  void established() {
    if (state_ != State::open) return;
    ++timerNumber_;
    call(&ConnectionHandlers::onConnected);
    flush();
    armRead();
  }

  void start(ConnectionHandlers handlers) override {
    handlers_ = std::make_shared<ConnectionHandlers>(std::move(handlers));
    if (state_ == State::closed) {
      loop_.at(network_.time(), [self = shared_from_this()] { self->notifyClosed(); });
    }
    armRead();
  }
  bool sendable() const override {
    return (state_ == State::connecting || state_ == State::open) && failure_.empty();
  }
  void send(std::shared_ptr<const Buffer> buffer, Delivery delivery) override {
    if (!sendable()) return;
    queue_.push(std::move(buffer), delivery, blocked_ && options_.unsentLimitBytes > 0);
    if (queue_.cost() <= options_.hardLimitBytes) return;
    flush();
    if (sendable() && queue_.cost() > options_.hardLimitBytes) {
      abort("the peer does not read: " + std::to_string(queue_.cost()) + " bytes wait for it, the limit is " +
            std::to_string(options_.hardLimitBytes));
    }
  }
  void flush() override {
    if ((state_ == State::open || state_ == State::flushing) && !blocked_ && !queue_.empty()) write();
  }
  void close(std::string reason) override {
    if (!sendable() || state_ == State::connecting) {
      if (state_ == State::connecting || state_ == State::open) finish(std::move(reason));
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
  void abort(std::string reason) override {
    aborted_ = true;
    finish(std::move(reason));
  }
  void release() noexcept override {
    handlers_.reset();
    loop_.guard([this] { shutDown(); });
  }
  void setPaused(bool paused) override {
    paused_ = paused;
    armRead();
  }
  void setLossDetection(milliseconds lossTimeout, std::chrono::seconds keepAlive) override {
    options_.lossTimeout = lossTimeout;
    options_.keepAlive = keepAlive;
    watchForLoss();
  }

  const Endpoint& local() const override { return local_; }
  const Endpoint& remote() const override { return remote_; }
  ConnectionStatistics statistics() override {
    return {bytesIn_, bytesOut_, queue_.droppedBuffers(), queue_.droppedBytes(), queue_.bytes(), inFlight_};
  }
  int nativeHandle() override { return -1; }
  std::optional<std::uint32_t> peerUser() noexcept override { return user_; }
  void belongsTo(std::uint32_t user) { user_ = user; }

  void beCut() {
    cut_ = true;
    watchForLoss();
  }
  void beReset() {
    loop_.arriving([self = shared_from_this()] { self->resetArrived(); });
  }

 private:
  enum class State { connecting, open, flushing, draining, closed };

  void announce();

  template <class Callback, class... Arguments>
  void call(Callback ConnectionHandlers::*callback, const Arguments&... arguments) {
    const auto handlers = handlers_;
    if (!handlers || !((*handlers).*callback)) return;
    if (auto error = errorOf([&] { ((*handlers).*callback)(arguments...); })) {
      finish("error while handling the connection: " + *error);
    }
  }

  // --- the wire

  void write() {
    constexpr std::size_t kMostParts = 64;
    const bool wasBlocked = std::exchange(blocked_, false);
    const auto other = other_.lock();
    while (!queue_.empty()) {
      const std::size_t used = inFlight_ + (other ? other->unread_.size() : 0);
      std::size_t room = network_.options.windowBytes - std::min(network_.options.windowBytes, used);
      Buffer bytes;
      std::array<std::span<const std::byte>, kMostParts> parts;
      const std::size_t count = queue_.gather(parts);
      bytes.reserve(std::min(room, queue_.bytes()));
      for (std::size_t i = 0; i < count && room > 0; ++i) {
        const auto part = parts[i].first(std::min(room, parts[i].size()));
        bytes.insert(bytes.end(), part.begin(), part.end());
        room -= part.size();
      }
      if (bytes.empty()) {
        blocked_ = true;
        return;
      }
      queue_.consume(bytes.size());
      bytesOut_ += bytes.size();
      inFlight_ += bytes.size();
      if (cut_) {
        watchForLoss();
        continue;
      }
      const std::weak_ptr<FakeConnection> self = weak_from_this();
      toOther([self, bytes = std::move(bytes)](FakeConnection& receiver) mutable {
        const auto sender = self.lock();
        if (sender) sender->inFlight_ -= bytes.size();
        if (receiver.cut_) return;
        if (receiver.state_ == State::closed) {
          if (sender) sender->beReset();
          return;
        }
        if (receiver.unread_.empty()) {
          receiver.unread_ = std::move(bytes);
        } else {
          receiver.unread_.insert(receiver.unread_.end(), bytes.begin(), bytes.end());
        }
        if (const auto& arrived = receiver.network_.options.arrived)
          arrived(receiver.local_, receiver.remote_, receiver.bytesIn_ + receiver.unread_.size());
        receiver.armRead();
      });
    }
    queueEmptied(wasBlocked);
  }

  // The function runs in the other end's loop after the delay; ends that are gone stay alive until then.
  template <class Function>
  void toOther(Function function) {
    if (const auto other = other_.lock()) {
      const Nanos jitter = network_.options.jitter ? network_.options.jitter() : 0;
      latest_ = std::max(latest_, network_.time() + network_.options.delay + jitter);
      other->loop_.at(latest_, [other, function = std::move(function)]() mutable { function(*other); });
    } else {
      beReset();
    }
  }

  void queueEmptied(bool wasBlocked) {
    if (state_ == State::flushing) {
      sendEnd();
      if (peerEnded_) {
        finish(reason_);
      } else {
        state_ = State::draining;
      }
    } else if (wasBlocked) {
      call(&ConnectionHandlers::onDrained);
    }
  }

  void sendEnd() {
    if (std::exchange(endSent_, true) || cut_ || other_.expired()) return;
    toOther([](FakeConnection& other) {
      if (other.cut_) return;
      other.endArrived_ = true;
      other.armRead();
    });
  }

  void resetArrived() {
    if (cut_ || state_ == State::closed) return;
    if (state_ != State::open) return finish(reason_);
    fail(kReset);
  }

  void fail(const char* why) {
    if (!failure_.empty()) return;
    failure_ = why;
    queue_.clear();
    blocked_ = false;
    armRead();
  }

  void watchForLoss() {
    if (!cut_ || options_.lossTimeout <= milliseconds::zero()) return;
    Nanos silence = nanos(options_.lossTimeout);
    if (inFlight_ == 0) {
      if (options_.keepAlive <= std::chrono::seconds::zero()) return;
      silence += nanos(options_.keepAlive);
    }
    loop_.at(network_.time() + silence, [self = shared_from_this()] {
      if (self->state_ == State::open) self->fail(kLostPeer);
    });
  }

  // --- reading

  void armRead() {
    if (state_ == State::open && paused_ && (endArrived_ || !failure_.empty())) reportPeerGone();
    const bool wanted = state_ == State::open ? handlers_ && !paused_
                                              : state_ == State::flushing || state_ == State::draining;
    const bool something = !unread_.empty() || endArrived_ || !failure_.empty();
    if (readArmed_ || peerEnded_ || !wanted || !something) return;
    readArmed_ = true;
    loop_.at(network_.time(), [self = shared_from_this()] { self->readable(); });
  }

  void readable() {
    readArmed_ = false;
    if (state_ == State::closed || (state_ == State::open && paused_)) return;
    if (!unread_.empty()) {
      deliver();
    } else if (!failure_.empty()) {
      finish(failure_);
    } else if (endArrived_) {
      peerEnded();
    }
    armRead();
  }

  void deliver() {
    constexpr std::size_t kReadBufferBytes = std::size_t{64} * 1024;
    std::size_t size = std::min(unread_.size(), kReadBufferBytes);
    if (network_.options.readSize) {
      size = std::clamp<std::size_t>(network_.options.readSize(unread_.size()), 1, size);
    }
    Buffer bytes;
    if (size == unread_.size()) {
      bytes.swap(unread_);
    } else {
      const auto end = unread_.begin() + static_cast<std::ptrdiff_t>(size);
      bytes.assign(unread_.begin(), end);
      unread_.erase(unread_.begin(), end);
    }
    bytesIn_ += size;
    const auto other = other_.lock();
    if (other && other->blocked_ && !cut_) {
      other->loop_.arriving([other] {
        if (other->blocked_ && (other->state_ == State::open || other->state_ == State::flushing))
          other->write();
      });
    }
    if (network_.options.reads) network_.options.reads(local_, remote_, size);
    if (state_ == State::open) call(&ConnectionHandlers::onBytes, std::span<const std::byte>(bytes));
    if (network_.options.hasRead) network_.options.hasRead(local_, remote_, bytesIn_);
  }

  void peerEnded() {
    peerEnded_ = true;
    if (state_ == State::flushing) return;
    if (state_ == State::open) flush();
    finish(kClosed);
  }

  void reportPeerGone() {
    if (peerGoneReported_ || !handlers_ || !handlers_->onPeerGone) return;
    peerGoneReported_ = true;
    const std::string reason = failure_.empty() ? kClosed : failure_;
    loop_.at(network_.time(), [self = shared_from_this(), reason] {
      if (self->state_ != State::closed) self->call(&ConnectionHandlers::onPeerGone, reason);
    });
  }

  // --- the end

  void armTimer(milliseconds timeout, std::string reason) {
    const std::uint64_t number = ++timerNumber_;
    loop_.at(network_.time() + nanos(timeout),
             [self = shared_from_this(), number, reason = std::move(reason)] {
               if (self->timerNumber_ == number) self->finish(reason);
             });
  }

  void finish(std::string reason) {
    if (state_ == State::closed) return;
    reason_ = state_ == State::flushing || state_ == State::draining ? reason_ : std::move(reason);
    shutDown();
    loop_.at(network_.time(), [self = shared_from_this()] { self->notifyClosed(); });
  }

  // As a system closes a socket: unread bytes make it a reset.
  void shutDown() {
    if (state_ == State::closed) return;
    const bool resets = aborted_ || !unread_.empty();
    state_ = State::closed;
    descriptor_.close();
    ++timerNumber_;
    queue_.clear();
    blocked_ = false;
    if (!resets) return sendEnd();
    if (!cut_ && !other_.expired()) toOther([](FakeConnection& other) { other.resetArrived(); });
  }

  void notifyClosed() {
    if (const auto handlers = std::move(handlers_); handlers && handlers->onClosed) {
      loop_.guard([&] { handlers->onClosed(reason_); });
    }
  }

  FakeLoop& loop_;
  FakeNetwork& network_;
  ConnectionOptions options_;
  std::shared_ptr<ConnectionHandlers> handlers_;
  SendQueue queue_;
  Endpoint local_;
  Endpoint remote_;
  std::weak_ptr<FakeConnection> other_;
  FakeDescriptor descriptor_;
  State state_ = State::connecting;
  std::optional<std::uint32_t> user_;  // of a Unix socket
  Buffer unread_;                      // arrived
  std::size_t inFlight_ = 0;           // sent, not yet arrived
  bool blocked_ = false;
  bool readArmed_ = false;
  bool paused_ = false;
  bool endArrived_ = false;
  bool endSent_ = false;
  bool peerEnded_ = false;
  bool peerGoneReported_ = false;
  bool aborted_ = false;
  bool cut_ = false;
  std::uint64_t timerNumber_ = 0;
  Nanos latest_ = 0;  // when the last piece that was sent arrives
  std::string failure_;
  std::string reason_;
  std::uint64_t bytesIn_ = 0;
  std::uint64_t bytesOut_ = 0;
};

class FakeListener final : public Acceptor {
 public:
  /// `path`: of a Unix socket, which the network knows by an endpoint, too.
  FakeListener(FakeLoop& loop, const Endpoint& local, std::function<void(Connection)> onAccept,
               const ConnectionOptions& options, std::string path = {})
      : Acceptor(loop),
        loop_(loop),
        local_(local),
        path_(std::move(path)),
        onAccept_(std::move(onAccept)),
        options_(options) {
    loop_.network().listeners_.push_back(this);
  }

  const Endpoint& local() const override { return local_; }
  const std::string& path() const { return path_; }

  FakeLoop& loop() { return loop_; }
  // The system establishes the connection, whether or not the program accepts it.
  void arrive(const std::shared_ptr<FakeConnection>& client) {
    const auto self = shared_from_this();
    auto here = std::make_shared<FakeConnection>(loop_, options_, client->remote(), client->local());
    loop_.network().connections_.push_back(here);
    if (!path_.empty()) here->belongsTo(loop_.network().localUser);
    here->establish(client);
    client->establish(here);
    pending_.push_back(std::move(here));
    if (std::exchange(waits_, false)) acceptPending();
  }

 private:
  // As Linux does it: the descriptor first.
  int acceptOne() override {
    FakeNetwork& network = loop_.network();
    if (!FakeDescriptor::available(loop_, network)) {
      if (network.options.refusedAccept) network.options.refusedAccept(local_, pending_.size());
      return EMFILE;
    }
    if (pending_.empty()) return EAGAIN;
    const auto here = std::move(pending_.front());
    pending_.pop_front();
    here->openDescriptor();
    loop_.guard([&] { onAccept_(Connection(here)); });
    return 0;
  }
  void waitForConnection() override {
    waits_ = pending_.empty();
    if (waits_) return;
    loop_.at(loop_.network().time(), [this, self = shared_from_this()] {
      if (isOpen()) acceptPending();
    });
  }
  bool connectionWaits() noexcept override { return !pending_.empty(); }
  void closeSocket() noexcept override {
    std::erase(loop_.network().listeners_, this);
    for (const auto& here : std::exchange(pending_, {})) here->abort("");
  }

  FakeLoop& loop_;
  const Endpoint local_;
  const std::string path_;
  const std::function<void(Connection)> onAccept_;
  const ConnectionOptions options_;
  std::deque<std::shared_ptr<FakeConnection>> pending_;  // established, not accepted
  bool waits_ = false;                                   // for one to arrive
};

// The listener accepts after one delay, the client learns of it after two.
void FakeConnection::announce() {
  const auto self = shared_from_this();
  network_.listenerAt(remote_)->loop().arriving([self] {
    FakeListener* const listener = self->network_.listenerAt(self->remote_);
    if (listener != nullptr && self->state_ == State::connecting && !self->cut_) listener->arrive(self);
    self->loop_.arriving([self] {
      if (self->state_ == State::connecting && !self->cut_) {
        self->finish("cannot connect to " + self->remote_.text() + ": Connection refused");
      }
      self->established();
    });
  });
}

// --- datagrams

class FakeUdpSocket final : public UdpSocket::Impl, public std::enable_shared_from_this<FakeUdpSocket> {
 public:
  FakeUdpSocket(FakeLoop& loop, const Endpoint& local) : loop_(loop), local_(local) {
    if (const int error = descriptor_.open(loop); error != 0) throw Error(bindErrorText("UDP", local, error));
    loop_.network().udpSockets_.push_back(this);
  }

  void start(UdpHandlers handlers) override {
    handlers_ = std::make_shared<UdpHandlers>(std::move(handlers));
    for (const auto& [bytes, from] : std::exchange(waiting_, {})) {
      loop_.at(loop_.network().time(),
               [self = shared_from_this(), b = bytes, f = from] { self->receive(b, f); });
    }
  }
  void connect(const Endpoint& peer) override {
    peer_ = peer;
    if (local_.address == kAnyAddress) local_.address = kLoopbackAddress;
  }
  bool send(std::span<const std::byte> bytes) override { return peer_ && sendTo(bytes, *peer_); }
  bool sendTo(std::span<const std::byte> bytes, const Endpoint& to) override {
    constexpr std::size_t kLargest = 65507;
    if (bytes.size() > kLargest) {
      ++statistics_.dropped;
      return false;
    }
    ++statistics_.datagramsOut;
    statistics_.bytesOut += bytes.size();
    FakeNetwork& network = loop_.network();
    const std::uint64_t number = network.datagrams_++;
    if (network.options.losesDatagram && network.options.losesDatagram(number)) return true;
    const Endpoint from{local_.address == kAnyAddress ? kLoopbackAddress : local_.address, local_.port};
    FakeUdpSocket* const there = network.udpSocketAt(to);
    if (there == nullptr) {
      if (peer_) loop_.arriving([self = shared_from_this()] { self->refuse(); });
      return true;
    }
    const Nanos jitter = network.options.jitter ? network.options.jitter() : 0;
    there->loop_.at(network.time() + network.options.delay + jitter,
                    [there = there->weak_from_this(), from, copy = Buffer(bytes.begin(), bytes.end())] {
                      if (const auto socket = there.lock()) socket->receive(copy, from);
                    });
    return true;
  }
  std::size_t sendBatch(std::span<const Datagram> datagrams) override {
    return static_cast<std::size_t>(std::count_if(
        datagrams.begin(), datagrams.end(), [this](const Datagram& d) { return sendTo(d.bytes, d.to); }));
  }
  void close() noexcept override {
    handlers_.reset();
    std::erase(loop_.network().udpSockets_, this);
    descriptor_.close();
    open_ = false;
  }
  const Endpoint& local() const override { return local_; }
  const UdpStatistics& statistics() const override { return statistics_; }

 private:
  void receive(const Buffer& bytes, const Endpoint& from) {
    if (!open_ || (peer_ && !(*peer_ == from))) return;
    if (!handlers_) {
      waiting_.emplace_back(bytes, from);
      return;
    }
    ++statistics_.datagramsIn;
    statistics_.bytesIn += bytes.size();
    if (const auto handlers = handlers_; handlers->onDatagram) {
      loop_.guard([&] { handlers->onDatagram(bytes, from); });
    }
  }
  void refuse() {
    ++statistics_.refused;
    if (const auto handlers = handlers_; handlers && handlers->onRefused) loop_.guard(handlers->onRefused);
  }

  FakeLoop& loop_;
  Endpoint local_;
  FakeDescriptor descriptor_;
  std::optional<Endpoint> peer_;
  std::shared_ptr<UdpHandlers> handlers_;
  std::vector<std::pair<Buffer, Endpoint>> waiting_;  // before start()
  UdpStatistics statistics_;
  bool open_ = true;
};

// --- what a loop makes

std::shared_ptr<Subscription::State> FakeLoop::after(Loop::Duration delay, std::function<void()> function) {
  auto timer = std::make_shared<FakeTimer>(*this, std::move(function), 0);
  timer->startAt(network_.time() + std::max<Nanos>(nanos(delay), 0));
  return timer;
}

std::shared_ptr<Subscription::State> FakeLoop::every(Loop::Duration period, std::function<void()> function) {
  auto timer = std::make_shared<FakeTimer>(*this, std::move(function), nanos(period));
  timer->startAt(network_.time() + nanos(period));
  return timer;
}

std::shared_ptr<Subscription::State> FakeLoop::watchFd(int fd, std::function<void()> function) {
  auto watch = std::make_shared<FakeWatch>(*this, std::move(function), fd);
  network_.watches_.push_back(watch);
  return watch;
}

std::shared_ptr<Connection::Impl> FakeLoop::connect(const Endpoint& peer, milliseconds timeout,
                                                    const ConnectionOptions& options) {
  const Endpoint local = network_.freeEndpoint({kLoopbackAddress, 0}, {}, "TCP", "");
  auto connection = std::make_shared<FakeConnection>(*this, options, local, peer);
  network_.connections_.push_back(connection);
  connection->connect(timeout);
  return connection;
}

std::shared_ptr<TcpListener::Impl> FakeLoop::listen(const Endpoint& local,
                                                    std::function<void(Connection)> onAccept,
                                                    const ConnectionOptions& options, const char* option) {
  std::vector<Endpoint> used;
  for (const FakeListener* listener : network_.listeners_) used.push_back(listener->local());
  const Endpoint bound = network_.freeEndpoint(local, used, "TCP", option);
  auto listener = std::make_shared<FakeListener>(*this, bound, std::move(onAccept), options);
  listener->start();
  return listener;
}

std::shared_ptr<UdpSocket::Impl> FakeLoop::bind(const Endpoint& local) {
  std::vector<Endpoint> used;
  for (const FakeUdpSocket* socket : network_.udpSockets_) used.push_back(socket->local());
  return std::make_shared<FakeUdpSocket>(*this, network_.freeEndpoint(local, used, "UDP", "--listen"));
}

std::shared_ptr<TcpListener::Impl> FakeLoop::listenLocal(const std::filesystem::path& path,
                                                         std::function<void(Connection)> onAccept,
                                                         const ConnectionOptions& options) {
  if (network_.listenerAt(path.string()) != nullptr)
    throw Error("cannot use the Unix socket " + path.string() + ": Address already in use");
  const Endpoint local = network_.freeEndpoint({kLoopbackAddress, 0}, {}, "Unix", "");
  auto listener = std::make_shared<FakeListener>(*this, local, std::move(onAccept), options, path.string());
  listener->start();
  return listener;
}

std::shared_ptr<Connection::Impl> FakeLoop::connectLocal(const std::filesystem::path& path,
                                                         const ConnectionOptions& options) {
  const FakeListener* const listener = network_.listenerAt(path.string());
  if (listener == nullptr)
    throw Error("cannot use the Unix socket " + path.string() + ": Connection refused");
  return connect(listener->local(), milliseconds(1000), options);
}

// --- the network

std::unique_ptr<Loop::Impl> FakeNetwork::makeLoop() {
  return std::make_unique<FakeLoop>(*this);
}

std::uint32_t FakeNetwork::resolve(const std::string& host) {
  if (host == "localhost") return kLoopbackAddress;
  if (const auto known = hosts.find(host); known != hosts.end()) return known->second;
  try {
    return Endpoint::parse(host).address;
  } catch (const Error&) {
    throw Error("cannot find host '" + host + "': Name or service not known");
  }
}

std::uint32_t FakeNetwork::localAddressTowards(const std::string& host) {
  resolve(host);
  return kLoopbackAddress;
}

void FakeNetwork::cut(const Endpoint& oneEnd) {
  for (const auto& weak : connections_) {
    const auto connection = weak.lock();
    if (connection && (connection->local() == oneEnd || connection->remote() == oneEnd)) connection->beCut();
  }
}

void FakeNetwork::reset(const Endpoint& oneEnd) {
  for (const auto& weak : connections_) {
    const auto connection = weak.lock();
    if (connection && (connection->local() == oneEnd || connection->remote() == oneEnd))
      connection->beReset();
  }
}

void FakeNetwork::schedule(Nanos when, std::size_t loop, std::function<void()> function) {
  Queue& queue = queues_[loop];
  if (queue.loop == nullptr) return;
  if (queue.free.empty()) {
    queue.free.push_back(queue.functions.size());
    queue.functions.emplace_back();
  }
  const std::size_t place = queue.free.back();
  queue.free.pop_back();
  queue.functions[place] = std::move(function);
  queue.events.push_back({std::max(when, time()), sequence_++, place});
  std::ranges::push_heap(queue.events, std::greater());
}

void FakeNetwork::pollWatches() {
  std::erase_if(watches_, [](const auto& watch) { return watch.expired(); });
  for (const auto& weak : std::vector(watches_)) {
    if (const auto watch = weak.lock()) watch->poll(time());
  }
}

std::optional<Nanos> FakeNetwork::next() {
  pollWatches();
  std::optional<Nanos> earliest;
  for (std::size_t i = 0; i < queues_.size(); ++i) {
    const auto when = nextOf(i);
    if (when && (!earliest || *when < *earliest)) earliest = when;
  }
  return earliest;
}

std::optional<Nanos> FakeNetwork::nextOf(std::size_t loop) const {
  const auto& events = queues_[loop].events;
  return events.empty() || queues_[loop].loop == nullptr ? std::nullopt : std::optional(events.front().when);
}

void FakeNetwork::runNextOf(std::size_t loop) {
  Queue& queue = queues_[loop];
  std::ranges::pop_heap(queue.events, std::greater());
  const std::size_t place = queue.events.back().function;
  queue.events.pop_back();
  const auto function = std::exchange(queue.functions[place], {});
  queue.free.push_back(place);
  ++events_;
  queue.loop->handle(function);
}

bool FakeNetwork::runNext(Nanos limit) {
  const auto when = next();
  if (!when || *when > limit) return false;
  clock_.sleepUntil(*when);
  std::size_t first = queues_.size();
  for (std::size_t i = 0; i < queues_.size(); ++i) {
    const auto& events = queues_[i].events;
    if (!nextOf(i)) continue;
    if (first == queues_.size() || queues_[first].events.front() > events.front()) first = i;
  }
  runNextOf(first);
  return true;
}

Endpoint FakeNetwork::freeEndpoint(const Endpoint& wanted, const std::vector<Endpoint>& used,
                                   const char* kind, const std::string& option) {
  constexpr std::uint32_t kLoopbackNet = 127;
  if (!options.otherMachines && wanted.address != kAnyAddress && wanted.address >> 24 != kLoopbackNet) {
    throw Error(bindErrorText(kind, wanted, EADDRNOTAVAIL, option));
  }
  if (wanted.port == 0) return {wanted.address, nextPort_++};
  for (const Endpoint& other : used) {
    if (other.port == wanted.port && (matches(other, wanted) || matches(wanted, other))) {
      throw Error(bindErrorText(kind, wanted, EADDRINUSE, option));
    }
  }
  return wanted;
}

FakeListener* FakeNetwork::listenerAt(const Endpoint& endpoint) const {
  for (FakeListener* listener : listeners_) {
    if (matches(listener->local(), endpoint)) return listener;
  }
  return nullptr;
}

FakeListener* FakeNetwork::listenerAt(const std::string& path) const {
  const auto found = std::find_if(listeners_.begin(), listeners_.end(),
                                  [&](const FakeListener* listener) { return listener->path() == path; });
  return found == listeners_.end() ? nullptr : *found;
}

FakeUdpSocket* FakeNetwork::udpSocketAt(const Endpoint& endpoint) const {
  for (FakeUdpSocket* socket : udpSockets_) {
    if (matches(socket->local(), endpoint)) return socket;
  }
  return nullptr;
}

}  // namespace hapticd::net

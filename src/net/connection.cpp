#include "net/connection.h"

#include "net/loop_impl.h"

namespace hapticd::net {

Connection::Connection(std::shared_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

Connection& Connection::operator=(Connection&& other) noexcept {
  if (this != &other) {
    const Connection old(std::move(impl_));
    impl_ = std::move(other.impl_);
  }
  return *this;
}

Connection::~Connection() {
  if (impl_) {
    impl_->release();
  }
}

Connection Connection::connect(Loop& loop, const Endpoint& peer, std::chrono::milliseconds timeout,
                               const ConnectionOptions& options) {
  return Connection(loop.impl().connect(peer, timeout, options));
}

void Connection::start(ConnectionHandlers handlers) {
  impl_->start(std::move(handlers));
}
bool Connection::isOpen() const noexcept {
  return impl_ && impl_->sendable();
}
void Connection::send(std::shared_ptr<const Buffer> buffer, Delivery delivery) {
  impl_->send(std::move(buffer), delivery);
}
void Connection::send(std::span<const std::byte> bytes, Delivery delivery) {
  impl_->send(std::make_shared<const Buffer>(bytes.begin(), bytes.end()), delivery);
}
void Connection::flush() {
  impl_->flush();
}
void Connection::close(std::string reason) {
  impl_->close(std::move(reason));
}
void Connection::abort(std::string reason) {
  impl_->abort(std::move(reason));
}
void Connection::pauseReading() {
  impl_->setPaused(true);
}
void Connection::resumeReading() {
  impl_->setPaused(false);
}
void Connection::setLossDetection(std::chrono::milliseconds lossTimeout, std::chrono::seconds keepAlive) {
  impl_->setLossDetection(lossTimeout, keepAlive);
}
const Endpoint& Connection::local() const noexcept {
  return impl_->local();
}
const Endpoint& Connection::remote() const noexcept {
  return impl_->remote();
}
std::size_t Connection::queuedBytes() const {
  return impl_->queuedBytes();
}

ConnectionStatistics Connection::statistics() const {
  return impl_->statistics();
}
int Connection::nativeHandle() const noexcept {
  return impl_->nativeHandle();
}

std::optional<std::uint32_t> Connection::peerUser() const noexcept {
  return impl_->peerUser();
}

}  // namespace hapticd::net

#include "net/udp_socket.h"

#include "net/loop_impl.h"

namespace hapticd::net {

UdpSocket::UdpSocket(Loop& loop, const Endpoint& local) : impl_(loop.impl().bind(local)) {}
UdpSocket::~UdpSocket() {
  impl_->close();
}
void UdpSocket::start(UdpHandlers handlers) {
  impl_->start(std::move(handlers));
}
void UdpSocket::connect(const Endpoint& peer) {
  impl_->connect(peer);
}
bool UdpSocket::send(std::span<const std::byte> bytes) {
  return impl_->send(bytes);
}
bool UdpSocket::sendTo(std::span<const std::byte> bytes, const Endpoint& to) {
  return impl_->sendTo(bytes, to);
}
std::size_t UdpSocket::sendBatch(std::span<const Datagram> datagrams) {
  return impl_->sendBatch(datagrams);
}
const Endpoint& UdpSocket::local() const noexcept {
  return impl_->local();
}
const UdpStatistics& UdpSocket::statistics() const noexcept {
  return impl_->statistics();
}

}  // namespace hapticd::net

#include "net/asio_udp_socket.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "net/socket_options.h"
//
#include <boost/asio/error.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/post.hpp>

namespace hapticd::net {

namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

namespace {

class AsioUdpSocket final : public UdpSocket::Impl, public std::enable_shared_from_this<AsioUdpSocket> {
 public:
  AsioUdpSocket(AsioLoop& loop, const Endpoint& local) : loop_(loop), socket_(loop.context) {
    try {
      socket_.open(udp::v4());
      setCloseOnExec(socket_.native_handle());
      socket_.bind(toAsio<udp::endpoint>(local));
      socket_.non_blocking(true);
      local_ = fromAsio(socket_.local_endpoint());
    } catch (const boost::system::system_error& error) {
      throw Error(bindErrorText("UDP", local, error.code().value()));
    }
  }

  void start(UdpHandlers handlers) override {
    handlers_ = std::make_shared<UdpHandlers>(std::move(handlers));
    arm();
  }

  void connect(const Endpoint& peer) override {
    error_code error;
    socket_.connect(toAsio<udp::endpoint>(peer), error);
    if (error) {
      throw Error("cannot send datagrams to " + peer.text() + ": " + error.message());
    }
    local_ = fromAsio(socket_.local_endpoint());
  }

  template <class Send>
  bool sendOne(std::size_t size, Send&& send) {
    error_code error;
    send(error);
    if (error == asio::error::connection_refused) {
      // The answer to an earlier datagram took the place of this one's result: it was not sent.
      countRefused();
      send(error);
    }
    if (error) {
      ++statistics_.dropped;
      return false;
    }
    countSent(size);
    return true;
  }

  bool send(std::span<const std::byte> bytes) override {
    return sendOne(bytes.size(), [&](error_code& error) {
      socket_.send(asio::buffer(bytes.data(), bytes.size()), 0, error);
    });
  }

  bool sendTo(std::span<const std::byte> bytes, const Endpoint& to) override {
    return sendOne(bytes.size(), [&](error_code& error) {
      socket_.send_to(asio::buffer(bytes.data(), bytes.size()), toAsio<udp::endpoint>(to), 0, error);
    });
  }

  std::size_t sendBatch(std::span<const Datagram> datagrams) override {
    std::size_t sent = 0;
    while (!datagrams.empty()) {
      const int result = sendSome(datagrams.first(std::min(datagrams.size(), kBatch)));
      const std::size_t count = result > 0 ? static_cast<std::size_t>(result) : 0;
      for (const Datagram& datagram : datagrams.first(count)) {
        countSent(datagram.bytes.size());
      }
      sent += count;
      datagrams = datagrams.subspan(count);
      if (result < 0 && (errno == EAGAIN || errno == ENOBUFS)) {
        statistics_.dropped += datagrams.size();
        return sent;
      }
      if (result < 0) {  // the first one is at fault: by itself it gets its one retry, or its drop
        sent += sendTo(datagrams.front().bytes, datagrams.front().to) ? 1 : 0;
        datagrams = datagrams.subspan(1);
      }
    }
    return sent;
  }

  void close() noexcept override {
    handlers_.reset();
    error_code ignored;
    socket_.close(ignored);
  }

  const Endpoint& local() const override { return local_; }
  const UdpStatistics& statistics() const override { return statistics_; }

 private:
  static constexpr std::size_t kBatch = 64;
  static constexpr int kMostPerWake = 64;

  void arm() {
    if (armed_ || !socket_.is_open()) {
      return;
    }
    armed_ = true;
    socket_.async_wait(udp::socket::wait_read, [this, self = shared_from_this()](const error_code&) {
      armed_ = false;
      receivePending();
      arm();
    });
  }

  void receivePending() {
    for (int i = 0; i < kMostPerWake && socket_.is_open(); ++i) {
      udp::endpoint from;
      error_code error;
      const std::size_t size = socket_.receive_from(
          asio::buffer(loop_.readBuffer.get(), AsioLoop::kReadBufferBytes), from, 0, error);
      if (error == asio::error::would_block) {
        return;
      }
      if (error) {
        countRefused();
        continue;
      }
      ++statistics_.datagramsIn;
      statistics_.bytesIn += size;
      if (const auto handlers = handlers_; handlers && handlers->onDatagram) {
        loop_.guard([&] { handlers->onDatagram({loop_.readBuffer.get(), size}, fromAsio(from)); });
      }
    }
  }

  // All errors of a bound datagram socket are answers to earlier datagrams (ICMP), of which refusal is the
  // one that a peer's end produces.
  void countRefused() {
    ++statistics_.refused;
    asio::post(loop_.context, [this, self = shared_from_this()] {
      if (const auto handlers = handlers_; handlers && handlers->onRefused) {
        loop_.guard(handlers->onRefused);
      }
    });
  }

  void countSent(std::size_t bytes) {
    ++statistics_.datagramsOut;
    statistics_.bytesOut += bytes;
  }

  int sendSome(std::span<const Datagram> datagrams) {
    std::array<mmsghdr, kBatch> messages{};
    std::array<iovec, kBatch> parts{};
    std::array<sockaddr_in, kBatch> addresses{};
    for (std::size_t i = 0; i < datagrams.size(); ++i) {
      const Datagram& datagram = datagrams[i];
      addresses[i].sin_family = AF_INET;
      addresses[i].sin_port = htons(datagram.to.port);
      addresses[i].sin_addr.s_addr = htonl(datagram.to.address);
      parts[i] = {const_cast<std::byte*>(datagram.bytes.data()), datagram.bytes.size()};
      messages[i].msg_hdr.msg_name = &addresses[i];
      messages[i].msg_hdr.msg_namelen = sizeof addresses[i];
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
    }
    return ::sendmmsg(socket_.native_handle(), messages.data(), static_cast<unsigned>(datagrams.size()),
                      MSG_NOSIGNAL);
  }

  AsioLoop& loop_;
  udp::socket socket_;
  // Shared, so that the captures of a callback outlive a socket that it destroys.
  std::shared_ptr<UdpHandlers> handlers_;
  Endpoint local_;
  UdpStatistics statistics_;
  bool armed_ = false;
};

}  // namespace

std::shared_ptr<UdpSocket::Impl> bindWithAsio(AsioLoop& loop, const Endpoint& local) {
  return std::make_shared<AsioUdpSocket>(loop, local);
}

}  // namespace hapticd::net

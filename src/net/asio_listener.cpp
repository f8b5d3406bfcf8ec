#include "net/asio_listener.h"

#include <cerrno>

#include "net/socket_options.h"
#include "net/tcp_connection.h"
//
#include <boost/asio/error.hpp>

namespace hapticd::net {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

class AsioListener final : public TcpListener::Impl, public std::enable_shared_from_this<AsioListener> {
 public:
  AsioListener(AsioLoop& loop, const Endpoint& local, std::function<void(Connection)> onAccept,
               const ConnectionOptions& options, const char* option)
      : loop_(loop),
        acceptor_(loop.context),
        retry_(loop.context),
        onAccept_(std::move(onAccept)),
        options_(options) {
    try {
      acceptor_.open(tcp::v4());
      setCloseOnExec(acceptor_.native_handle());
      acceptor_.set_option(tcp::acceptor::reuse_address(true));
      acceptor_.bind(toAsio<tcp::endpoint>(local));
      acceptor_.listen(kBacklog);
      acceptor_.non_blocking(true);
      local_ = fromAsio(acceptor_.local_endpoint());
    } catch (const boost::system::system_error& error) {
      throw Error(bindErrorText("TCP", local, error.code().value(), option));
    }
  }

  void arm() {
    acceptor_.async_wait(tcp::acceptor::wait_read, [this, self = shared_from_this()](const error_code&) {
      if (acceptor_.is_open()) {
        acceptPending();
      }
    });
  }

  void close() noexcept override {
    loop_.guard([this] {
      error_code ignored;
      acceptor_.close(ignored);
      retry_.cancel();
    });
  }

  const Endpoint& local() const override { return local_; }

 private:
  static constexpr int kBacklog = 4096;
  static constexpr int kMostPerWake = 8;  // others have their turn in between
  static constexpr std::chrono::milliseconds kRetry{100};

  void acceptPending() {
    for (int i = 0; i < kMostPerWake && acceptor_.is_open(); ++i) {
      tcp::socket socket(loop_.context);
      error_code error;
      acceptor_.accept(socket, error);
      if (!error) {
        handOver(std::move(socket));
      } else if (error == asio::error::would_block) {
        break;
      } else if (error == asio::error::no_descriptors || error == asio::error::no_memory ||
                 error == asio::error::no_buffer_space || error.value() == ENFILE) {
        retryLater(error);
        return;
      }  // any other error belongs to a connection that ended in the queue
    }
    if (acceptor_.is_open()) {
      arm();
    }
  }

  void handOver(tcp::socket socket) {
    loop_.guard([&] {
      auto impl = std::make_shared<TcpConnection>(loop_, options_);
      impl->adopt(std::move(socket));
      onAccept_(Connection(std::move(impl)));
    });
  }

  // The connection stays pending, so waiting for readiness would spin.
  void retryLater(const error_code& error) {
    loop_.report("cannot accept a connection on " + local_.text() + ": " + error.message());
    retry_.expires_after(kRetry);
    retry_.async_wait([this, self = shared_from_this()](const error_code&) {
      if (acceptor_.is_open()) {
        acceptPending();
      }
    });
  }

  AsioLoop& loop_;
  tcp::acceptor acceptor_;
  asio::steady_timer retry_;
  std::function<void(Connection)> onAccept_;
  ConnectionOptions options_;
  Endpoint local_;
};

}  // namespace

std::shared_ptr<TcpListener::Impl> listenWithAsio(AsioLoop& loop, const Endpoint& local,
                                                  std::function<void(Connection)> onAccept,
                                                  const ConnectionOptions& options, const char* option) {
  auto listener = std::make_shared<AsioListener>(loop, local, std::move(onAccept), options, option);
  listener->arm();
  return listener;
}

}  // namespace hapticd::net

#include "net/asio_listener.h"

#include <sys/stat.h>
#include <unistd.h>

#include "net/acceptor.h"
#include "net/socket_options.h"
#include "net/tcp_connection.h"
#include "net/unix_socket.h"
//
#include <boost/asio/error.hpp>

namespace hapticd::net {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

class AsioListener final : public Acceptor {
 public:
  AsioListener(AsioLoop& loop, std::function<void(Connection)> onAccept, const ConnectionOptions& options)
      : Acceptor(loop),
        loop_(loop),
        acceptor_(loop.context),
        onAccept_(std::move(onAccept)),
        options_(options) {}

  void listen(const Endpoint& local, const char* option) {
    try {
      acceptor_.open(tcp::v4());
      setCloseOnExec(acceptor_.native_handle());
      acceptor_.set_option(tcp::acceptor::reuse_address(true));
      acceptor_.bind(toAsio<tcp::endpoint>(local));
      acceptor_.listen(kBacklog);
      neverBlock();
      local_ = fromAsio(acceptor_.local_endpoint());
      address_ = local_.text();
    } catch (const boost::system::system_error& error) {
      throw Error(bindErrorText("TCP", local, error.code().value(), option));
    }
    start();
  }

  void listenLocally(const std::filesystem::path& path) {
    const int fd = listenAt(path);
    address_ = path.string();
    ::lstat(address_.c_str(), &file_);
    local_ = {kLoopbackAddress, 0};
    isLocal_ = true;
    error_code error;
    acceptor_.assign(tcp::v4(), fd, error);  // Asio does not look at the kind
    if (error) {
      ::close(fd);
      throw Error("cannot watch the Unix socket " + address_ + ": " + error.message());
    }
    neverBlock();
    start();
  }

  const Endpoint& local() const override { return local_; }

 private:
  static constexpr int kBacklog = 4096;

  int acceptOne() override {
    tcp::socket socket(loop_.context);
    error_code error;
    tcp::endpoint remote;  // also of a peer that is gone already
    if (isLocal_) {
      acceptor_.accept(socket, error);
    } else {
      acceptor_.accept(socket, remote, error);
    }
    if (error) return error.value();
    loop_.guard([&] {
      auto impl = std::make_shared<TcpConnection>(loop_, options_);
      if (isLocal_) {
        impl->adoptLocal(std::move(socket));
      } else {
        impl->adopt(std::move(socket), fromAsio(remote));
      }
      onAccept_(Connection(std::move(impl)));
    });
    return 0;
  }

  // Asio waits for the next connection when one was aborted, also where nothing should block, unless it is
  // asked for the error.
  void neverBlock() {
    acceptor_.non_blocking(true);
    acceptor_.set_option(tcp::acceptor::enable_connection_aborted(true));
  }

  void waitForConnection() override {
    acceptor_.async_wait(tcp::acceptor::wait_read, [this, self = shared_from_this()](const error_code&) {
      if (isOpen()) acceptPending();
    });
  }

  bool connectionWaits() noexcept override { return isReadable(acceptor_.native_handle()); }

  void closeSocket() noexcept override {
    // Somebody may have removed it, and another server may have its own there.
    struct stat present {};
    if (isLocal_ && ::lstat(address_.c_str(), &present) == 0 && present.st_dev == file_.st_dev &&
        present.st_ino == file_.st_ino) {
      ::unlink(address_.c_str());
    }
    error_code ignored;
    acceptor_.close(ignored);
  }

  std::string address() const override { return address_; }

  AsioLoop& loop_;
  tcp::acceptor acceptor_;
  std::function<void(Connection)> onAccept_;
  ConnectionOptions options_;
  Endpoint local_;
  std::string address_;
  bool isLocal_ = false;  // a Unix socket
  struct stat file_ {};   // of its path
};

}  // namespace

std::shared_ptr<TcpListener::Impl> listenWithAsio(AsioLoop& loop, const Endpoint& local,
                                                  std::function<void(Connection)> onAccept,
                                                  const ConnectionOptions& options, const char* option) {
  auto listener = std::make_shared<AsioListener>(loop, std::move(onAccept), options);
  listener->listen(local, option);
  return listener;
}

std::shared_ptr<TcpListener::Impl> listenLocallyWithAsio(AsioLoop& loop, const std::filesystem::path& path,
                                                         std::function<void(Connection)> onAccept,
                                                         const ConnectionOptions& options) {
  auto listener = std::make_shared<AsioListener>(loop, std::move(onAccept), options);
  listener->listenLocally(path);
  return listener;
}

}  // namespace hapticd::net

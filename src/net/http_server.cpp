#include "net/http_server.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <vector>

#include "net/http_connection.h"
#include "net/tcp_listener.h"

namespace hapticd::net {

class HttpServer::Impl {
 public:
  Impl(Loop& loop, const Endpoint& local, Handler onRequest, const HttpOptions& options, const char* option)
      : loop_(loop),
        options_(options),
        onRequest_(std::move(onRequest)),
        listener_(
            loop, local, [this](Connection connection) { accept(std::move(connection)); }, options.connection,
            option) {}

  const Endpoint& local() const { return listener_.local(); }
  std::size_t connections() const { return clients_.size(); }

 private:
  struct Client {
    std::uint32_t address;
    std::shared_ptr<HttpConnection> connection;
  };

  // One too many is closed at once: the others are bounded in time, so there will be room again.
  void accept(Connection connection) {
    const std::uint32_t address = connection.remote().address;
    if (!hasRoomFor(address)) {
      connection.abort("too many connections");
      return;
    }
    if (options_.secured) connection = options_.secured(std::move(connection));
    if (!connection) return;
    auto client = std::make_shared<HttpConnection>(
        loop_, std::move(connection), options_, onRequest_, [this](HttpConnection* gone) {
          std::erase_if(clients_, [&](const Client& c) { return c.connection.get() == gone; });
        });
    clients_.push_back({address, client});
    client->start();
  }

  // Whoever waits for no answer makes room: of the address that holds the most connections, and not for one
  // that holds more; first the oldest that has not begun a request.
  bool hasRoomFor(std::uint32_t address) {
    if (clients_.size() < options_.connections) return true;
    std::map<std::uint32_t, std::size_t> held;
    for (const Client& client : clients_) ++held[client.address];
    const auto mayStay = [&](const Client& c) {
      return c.connection->isAnswering() || held[c.address] < held[address];
    };
    const auto rank = [&](const Client& c) {
      return std::tuple(!mayStay(c), held[c.address], c.connection->isIdle());
    };
    const auto first = std::ranges::max_element(clients_, {}, rank);
    if (first == clients_.end() || mayStay(*first)) return false;
    clients_.erase(first);
    return true;
  }

  Loop& loop_;
  const HttpOptions options_;
  const Handler onRequest_;
  std::vector<Client> clients_;  // in the order in which they came
  TcpListener listener_;
};

void HttpReply::operator()(HttpResponse response) const {
  response.headers.insert(response.headers.end(), headers_.begin(), headers_.end());
  if (const auto connection = connection_.lock()) connection->answer(request_, std::move(response));
}

HttpServer::HttpServer(Loop& loop, const Endpoint& local, Handler onRequest, const HttpOptions& options,
                       const char* option)
    : impl_(std::make_unique<Impl>(loop, local, std::move(onRequest), options, option)) {}
HttpServer::~HttpServer() = default;

const Endpoint& HttpServer::local() const noexcept {
  return impl_->local();
}
std::size_t HttpServer::connections() const noexcept {
  return impl_->connections();
}

}  // namespace hapticd::net

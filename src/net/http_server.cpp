#include "net/http_server.h"

#include <map>

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
  std::size_t connections() const { return connections_.size(); }

 private:
  // One too many is closed at once: the others are bounded in time, so there will be room again.
  void accept(Connection connection) {
    if (connections_.size() >= options_.connections) {
      connection.abort("too many connections");
      return;
    }
    if (options_.secured) connection = options_.secured(std::move(connection));
    if (!connection) return;
    auto client =
        std::make_shared<HttpConnection>(loop_, std::move(connection), options_, onRequest_,
                                         [this](HttpConnection* gone) { connections_.erase(gone); });
    connections_.emplace(client.get(), client);
    client->start();
  }

  Loop& loop_;
  const HttpOptions options_;
  const Handler onRequest_;
  std::map<HttpConnection*, std::shared_ptr<HttpConnection>> connections_;
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

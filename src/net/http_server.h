// A small HTTP/1.1 server: requests by callback, answers now or later, WebSockets as Connections.
//
// Bounded: in connections, in the size of a request, and in the time that a client may take to send one or to
// read the answer. Each connection is read one request at a time.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>

#include "net/http_message.h"
#include "net/loop.h"

namespace hapticd::net {

struct HttpOptions {
  std::size_t connections = 64;  ///< at once; WebSockets are not counted, they belong to their owners
  std::size_t headerBytes = 8192;
  std::size_t bodyBytes = 4096;
  std::chrono::milliseconds requestTimeout{10000};  ///< from the first byte of a request to its last
  std::chrono::milliseconds idleTimeout{60000};     ///< without a request
  std::chrono::milliseconds answerTimeout{30000};   ///< for the handler, then for the client to read a piece
  ConnectionOptions connection;
  /// Puts encryption around an accepted connection; an empty one refuses it. Empty: none.
  std::function<Connection(Connection)> secured = {};
};

class HttpConnection;

/// Answers one request, once, in the loop's thread; copies refer to the same request. An answer after the end
/// of the connection is dropped.
class HttpReply {
 public:
  HttpReply(std::weak_ptr<HttpConnection> connection, std::uint64_t request)
      : connection_(std::move(connection)), request_(request) {}
  void operator()(HttpResponse response) const;
  /// The same answer, with these headers besides its own.
  HttpReply with(std::vector<std::pair<std::string, std::string>> headers) const {
    HttpReply reply = *this;
    reply.headers_ = std::move(headers);
    return reply;
  }

 private:
  std::vector<std::pair<std::string, std::string>> headers_;
  std::weak_ptr<HttpConnection> connection_;
  std::uint64_t request_;
};

/// Listens from construction to destruction. Answers malformed requests itself, with a status and a text.
class HttpServer {
 public:
  using Handler = std::function<void(const HttpRequest&, const HttpReply&)>;
  class Impl;

  /// Port 0 lets the system choose one, see local(). `option` is the option that error texts name. Throws
  /// Error.
  HttpServer(Loop& loop, const Endpoint& local, Handler onRequest, const HttpOptions& options = {},
             const char* option = "--http");
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  const Endpoint& local() const noexcept;
  /// Open connections, without WebSockets.
  std::size_t connections() const noexcept;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd::net

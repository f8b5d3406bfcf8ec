// One client of an HttpServer.
#pragma once

#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <optional>
#include <string>

#include "net/connection.h"
#include "net/http_server.h"
#include "net/loop.h"

namespace hapticd::net {

// idle -> receiving (the first bytes of a request) -> answering (until the client has it) -> idle.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  /// `onGone` is called once, when this object is finished.
  HttpConnection(Loop& loop, Connection connection, const HttpOptions& options,
                 const HttpServer::Handler& onRequest, std::function<void(HttpConnection*)> onGone);

  void start();
  /// Answers the request with that number if it is the pending one.
  void answer(std::uint64_t request, HttpResponse response);

  /// Between two requests, or before the first.
  bool isIdle() const noexcept { return state_ == State::idle; }
  bool isAnswering() const noexcept { return state_ == State::answering; }

 private:
  using Parser = boost::beast::http::request_parser<boost::beast::http::string_body>;
  enum class State { idle, receiving, answering, closing };

  void receive(std::span<const std::byte> bytes);
  void readOn();
  void parse();
  void askForBody();
  void ask();
  void refuse(int status, std::string_view text);
  void sendHead(const HttpResponse& response);
  void sendBody();
  void answered();
  void becomeWebSocket(const HttpResponse& response);
  void limit(std::chrono::milliseconds time, const char* text);
  void gone();

  Loop& loop_;
  Connection connection_;
  const HttpOptions& options_;
  const HttpServer::Handler& onRequest_;
  std::function<void(HttpConnection*)> onGone_;
  Subscription timer_;
  State state_ = State::idle;
  std::string input_;
  std::optional<Parser> parser_;
  std::string webSocketKey_;
  std::uint64_t request_ = 0;
  bool headOnly_ = false;
  bool keepAlive_ = false;
  bool old_ = false;  // HTTP/1.0
  bool askedForBody_ = false;
  std::shared_ptr<const Buffer> body_;
  std::size_t bodySent_ = 0;
};

}  // namespace hapticd::net

#include "net/http_connection.h"

#include <algorithm>
#include <boost/beast/http/status.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <cctype>

#include "net/web_socket.h"

namespace hapticd::net {

namespace http = boost::beast::http;

namespace {

std::string lowerCase(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

// A target may be a whole address (RFC 9112, 3.2.2). Its name of the server then counts, not that of the Host
// header, so that whoever judges the header judges that name.
void takeWholeAddress(HttpRequest& request) {
  const std::size_t colon = request.target.find("://");
  if (colon == std::string::npos) return;
  const std::string scheme = lowerCase(std::string_view(request.target).substr(0, colon));
  if (scheme != "http" && scheme != "https") return;
  const std::size_t begin = colon + 3;
  const std::size_t end = std::min(request.target.find_first_of("/?", begin), request.target.size());
  for (auto& [name, value] : request.headers) {
    if (name == "host") value = request.target.substr(begin, end - begin);
  }
  request.target.erase(0, end);
  if (!request.target.starts_with('/')) request.target.insert(0, 1, '/');
}

HttpRequest requestFrom(http::request<http::string_body>&& message) {
  HttpRequest request;
  request.method = std::string(message.method_string());
  request.target = std::string(message.target());
  for (const auto& field : message) {
    request.headers.emplace_back(lowerCase(field.name_string()), std::string(field.value()));
  }
  takeWholeAddress(request);
  request.wantsWebSocket = boost::beast::websocket::is_upgrade(message);
  request.body = std::move(message.body());
  return request;
}

}  // namespace

HttpConnection::HttpConnection(Loop& loop, Connection connection, const HttpOptions& options,
                               const HttpServer::Handler& onRequest,
                               std::function<void(HttpConnection*)> onGone)
    : loop_(loop),
      connection_(std::move(connection)),
      options_(options),
      onRequest_(onRequest),
      onGone_(std::move(onGone)) {}

void HttpConnection::start() {
  const std::weak_ptr<HttpConnection> weak = weak_from_this();
  connection_.start({.onConnected = {},
                     .onBytes =
                         [weak](std::span<const std::byte> bytes) {
                           if (const auto self = weak.lock()) self->receive(bytes);
                         },
                     .onDrained =
                         [weak] {
                           if (const auto self = weak.lock()) self->sendBody();
                         },
                     .onClosed =
                         [weak](const std::string&) {
                           if (const auto self = weak.lock()) self->gone();
                         }});
  limit(options_.idleTimeout, "no request in time");
}

// --- the request

void HttpConnection::receive(std::span<const std::byte> bytes) {
  input_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  readOn();
}

void HttpConnection::readOn() {
  if (input_.empty() || (state_ != State::idle && state_ != State::receiving)) return;
  if (state_ == State::idle) {
    state_ = State::receiving;
    parser_.emplace();
    parser_->header_limit(static_cast<std::uint32_t>(options_.headerBytes));
    parser_->body_limit(options_.bodyBytes);
    parser_->eager(true);
    askedForBody_ = false;
    limit(options_.requestTimeout, "the request was not complete in time");
  }
  parse();
}

void HttpConnection::parse() {
  boost::system::error_code error;
  const std::size_t used = parser_->put(boost::asio::buffer(input_), error);
  input_.erase(0, used);
  if (error == http::error::need_more) {
    // The parser counts only consumed bytes, and consumes nothing until a header line is complete.
    if (input_.size() > options_.headerBytes) refuse(431, "the header of the request is too long");
  } else if (error == http::error::header_limit) {
    refuse(431, "the header of the request is too long");
  } else if (error == http::error::body_limit) {
    refuse(413, "the body of the request is too long");
  } else if (error) {
    refuse(400, "malformed HTTP request: " + error.message());
  } else if (parser_->is_done()) {
    ask();
  } else {
    askForBody();
  }
}

// A client may wait with the body until it is told that it is wanted.
void HttpConnection::askForBody() {
  const auto& message = parser_->get();
  if (askedForBody_ || !parser_->is_header_done() || message.version() < 11) return;
  askedForBody_ = true;
  if (lowerCase(message[http::field::expect]) != "100-continue") return;
  constexpr std::string_view kGo = "HTTP/1.1 100 Continue\r\n\r\n";
  connection_.send(std::as_bytes(std::span(kGo)));
  connection_.flush();
}

void HttpConnection::ask() {
  state_ = State::answering;
  keepAlive_ = parser_->keep_alive();
  old_ = parser_->get().version() < 11;
  HttpRequest request = requestFrom(parser_->release());
  parser_.reset();
  // Of another coding the parser does not know where the body ends, and would take it for the next request.
  const std::string coding = lowerCase(request.header("transfer-encoding"));
  if (!coding.empty() && (coding != "chunked" || request.count("transfer-encoding") != 1)) {
    return refuse(501, "the transfer coding of the request is not chunked");
  }
  request.local = connection_.local();
  request.remote = connection_.remote();
  headOnly_ = request.method == "HEAD";
  webSocketKey_ = request.wantsWebSocket ? std::string(request.header("sec-websocket-key")) : "";
  ++request_;
  connection_.pauseReading();
  limit(options_.answerTimeout, "the answer was not read in time");
  if (request.wantsWebSocket && request.header("sec-websocket-version") != "13") {
    HttpResponse response = HttpResponse::of(426, "this server speaks WebSocket version 13\n");
    response.headers = {{"Sec-WebSocket-Version", "13"}};
    return answer(request_, std::move(response));
  }
  if (request.wantsWebSocket && webSocketKey_.size() != 24) {
    return refuse(400, "Sec-WebSocket-Key is not the base64 of 16 bytes");
  }
  onRequest_(request, HttpReply(weak_from_this(), request_));
}

// After a malformed request the start of the next one is unknown.
void HttpConnection::refuse(int status, std::string_view text) {
  state_ = State::answering;
  keepAlive_ = false;
  answer(request_, HttpResponse::of(status, std::string(text) + '\n'));
}

// --- the answer

void HttpConnection::answer(std::uint64_t request, HttpResponse response) {
  if (state_ != State::answering || request != request_ || body_) return;
  if (response.onWebSocket && !webSocketKey_.empty()) return becomeWebSocket(response);
  sendHead(response);
  static const auto nothing = std::make_shared<const Buffer>();
  body_ = response.body && !headOnly_ ? response.body : nothing;
  bodySent_ = 0;
  sendBody();
}

void HttpConnection::sendHead(const HttpResponse& response) {
  std::string head = "HTTP/1.1 " + std::to_string(response.status) + ' ';
  head += http::obsolete_reason(static_cast<http::status>(response.status));
  head += "\r\nContent-Type: " + response.contentType;
  head += "\r\nContent-Length: " + std::to_string(response.body ? response.body->size() : 0);
  for (const auto& [name, value] : response.headers) head += "\r\n" + name + ": " + value;
  // Of HTTP/1.1 the connection stays, of HTTP/1.0 it ends, unless the answer says so.
  if (!keepAlive_) head += "\r\nConnection: close";
  if (keepAlive_ && old_) head += "\r\nConnection: keep-alive";
  head += "\r\n\r\n";
  connection_.send(std::as_bytes(std::span(head)));
}

// In pieces, each after the system has accepted the previous one: a slow client costs the memory of one
// piece.
void HttpConnection::sendBody() {
  constexpr std::size_t kPiece = std::size_t{256} * 1024;
  while (state_ == State::answering && body_) {
    const std::size_t size = std::min(kPiece, body_->size() - bodySent_);
    if (size > 0) connection_.send(std::span(*body_).subspan(bodySent_, size));
    bodySent_ += size;
    connection_.flush();
    // Reading is paused, so this is the only place that notices a client that is gone.
    if (!connection_.isOpen()) return connection_.abort("the client is gone");
    if (connection_.queuedBytes() > 0) return limit(options_.answerTimeout, "the answer is not read");
    if (bodySent_ == body_->size()) answered();
  }
}

void HttpConnection::answered() {
  body_.reset();
  if (!keepAlive_) {
    state_ = State::closing;
    timer_.cancel();
    connection_.close("answered");
    return;
  }
  state_ = State::idle;
  limit(options_.idleTimeout, "no request in time");
  connection_.resumeReading();
  // Posted: a client that pipelines thousands of requests must not starve the others.
  if (input_.empty()) return;
  loop_.post([weak = weak_from_this()] {
    if (const auto self = weak.lock()) self->readOn();
  });
}

void HttpConnection::becomeWebSocket(const HttpResponse& response) {
  const std::string head =
      "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
      "Sec-WebSocket-Accept: " +
      webSocketAccept(webSocketKey_) + "\r\n\r\n";
  connection_.send(std::as_bytes(std::span(head)));
  connection_.flush();
  connection_.resumeReading();
  const auto ahead = std::as_bytes(std::span(input_));
  const auto content = response.webSocketOfTexts ? WebSocketContent::texts : WebSocketContent::bytes;
  auto socket = std::make_shared<WebSocket>(loop_.impl(), std::move(connection_),
                                            Buffer(ahead.begin(), ahead.end()), content);
  const auto self = shared_from_this();
  gone();
  response.onWebSocket(Connection(std::move(socket)));
}

// --- the end

void HttpConnection::limit(std::chrono::milliseconds time, const char* text) {
  timer_ = loop_.after(time, [this, text] { connection_.abort(text); });
}

void HttpConnection::gone() {
  state_ = State::closing;
  timer_.cancel();
  if (const auto onGone = std::exchange(onGone_, nullptr)) onGone(this);
}

}  // namespace hapticd::net

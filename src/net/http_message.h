// A request and its response, as values.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "net/connection.h"

namespace hapticd::net {

struct HttpRequest {
  std::string method;  ///< as sent: "GET"
  std::string target;  ///< "/api/mesh?scene=0"; of "http://HOST/x" its "/x"
  std::vector<std::pair<std::string, std::string>> headers;  ///< names in lower case, in order of arrival
  std::string body;
  Endpoint local;
  Endpoint remote;
  bool wantsWebSocket = false;

  /// The target up to the question mark.
  std::string_view path() const {
    const std::string_view all = target;
    return all.substr(0, all.find('?'));
  }
  /// The value of "name=value" after the question mark, as sent.
  std::optional<std::string_view> parameter(std::string_view name) const;
  /// Number of headers with this name (lower case).
  std::size_t count(std::string_view name) const;
  /// The first header with this name; empty when there is none.
  std::string_view header(std::string_view name) const;
};

struct HttpResponse {
  int status = 200;
  std::string contentType = "text/plain; charset=utf-8";
  std::vector<std::pair<std::string, std::string>> headers;  ///< besides Content-Type and -Length
  std::shared_ptr<const Buffer> body;                        ///< shared: never copied as a whole
  /// Takes the connection when the request wants a WebSocket; the rest of the response is then ignored.
  std::function<void(Connection)> onWebSocket;
  /// Of that connection: texts instead of a byte stream, one in each onBytes and in each buffer sent.
  bool webSocketOfTexts = false;

  /// A response with a text.
  static HttpResponse of(int status, std::string_view text,
                         std::string contentType = "text/plain; charset=utf-8");
};

}  // namespace hapticd::net

// Access control of the HTTP port: our own pages and programs may use it, pages of other sites may not.
//
// A browser lets any web page send requests to this machine. The Origin header names the site that the page
// comes from. The Host header names the server that the browser believes it talks to, which reveals DNS
// rebinding: a foreign name that resolves to this machine.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "net/http_message.h"

namespace hapticd::server {

/// No side effects. `local` is the listening address; `allowed` are further names, HOST (with our port) or
/// HOST:PORT.
class WebAccess {
 public:
  WebAccess(const net::Endpoint& local, std::vector<std::string> allowed);

  /// Why the request is refused, as a sentence; empty when it is allowed.
  std::string refusal(const net::HttpRequest& request) const;

 private:
  bool isOurs(std::string_view authority, std::string_view portOfScheme,
              const net::HttpRequest& request) const;

  std::uint16_t port_;
  std::vector<std::string> hosts_;  // lower case, with the port
};

}  // namespace hapticd::server

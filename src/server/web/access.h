// Who may talk to the web port: pages of our own and programs, no page of somebody else's.
//
// A browser lets any page in the world send requests to this machine. It tells by Origin where the page is
// from, and by Host which name it believes to talk to: a name of somebody else's that was made to lead here
// (DNS rebinding) shows there.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "net/http_message.h"

namespace hapticd::server {

/// Pure. `local` is where the port listens; `allowed` are further names, HOST for our own port or HOST:PORT.
class WebAccess {
 public:
  WebAccess(const net::Endpoint& local, std::vector<std::string> allowed);

  /// Empty when the request may pass, else why not, in a plain sentence.
  std::string refusal(const net::HttpRequest& request) const;

 private:
  bool isOurs(std::string_view authority, std::string_view portOfScheme,
              const net::HttpRequest& request) const;

  std::uint16_t port_;
  std::vector<std::string> hosts_;  // lower case, with port
};

}  // namespace hapticd::server

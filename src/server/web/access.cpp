#include "server/web/access.h"

#include <algorithm>
#include <cctype>

#include "wire/text.h"

namespace hapticd::server {
namespace {

std::string lowerCase(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

// HOST:PORT of a Host header or an Origin; a missing port is the default of the scheme.
std::string withPort(std::string_view authority, std::string_view portOfScheme) {
  const std::size_t colon = authority.rfind(':');
  const std::size_t bracket = authority.rfind(']');
  const bool has = colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket);
  return lowerCase(authority) + (has ? "" : std::string(portOfScheme));
}

std::string quoted(std::string_view text) {
  constexpr std::size_t kMost = 80;
  return wire::inQuotes(std::string(text.substr(0, kMost)));
}

}  // namespace

WebAccess::WebAccess(const net::Endpoint& local, std::vector<std::string> allowed) : port_(local.port) {
  const std::string port = ':' + std::to_string(port_);
  for (const char* name : {"localhost", "127.0.0.1", "[::1]"}) hosts_.push_back(name + port);
  if (local.address != net::kAnyAddress) hosts_.push_back(local.text());
  for (const std::string& name : allowed) {
    hosts_.push_back(lowerCase(name) + (name.find(':') == std::string::npos ? port : ""));
  }
}

// The address that the client connected to is always ours: unlike a name, an address cannot be rebound.
bool WebAccess::isOurs(std::string_view authority, std::string_view portOfScheme,
                       const net::HttpRequest& request) const {
  const std::string host = withPort(authority, portOfScheme);
  return std::find(hosts_.begin(), hosts_.end(), host) != hosts_.end() ||
         host == net::Endpoint{request.local.address, port_}.text();
}

std::string WebAccess::refusal(const net::HttpRequest& request) const {
  if (request.count("host") != 1) return "a request must have exactly one Host header";
  const std::string_view host = request.header("host");
  // Whether the connection is encrypted is not known here; a port is no protection against a name.
  if (!isOurs(host, ":80", request) && !isOurs(host, ":443", request)) {
    return "this server does not answer to the name " + quoted(host) +
           ": use its address, or allow the name with --http-allow if it is yours";
  }
  bool allowedOrigin = false;
  for (const auto& [name, value] : request.headers) {
    if (name != "origin") continue;
    const std::string_view origin = value;
    allowedOrigin = (origin.starts_with("http://") && isOurs(origin.substr(7), ":80", request)) ||
                    (origin.starts_with("https://") && isOurs(origin.substr(8), ":443", request));
    if (allowedOrigin) continue;
    return "pages from " + quoted(origin) + " may not use this server";
  }
  // Browsers load images and scripts for other sites' pages without an Origin header.
  if (!allowedOrigin && request.header("sec-fetch-site") == "cross-site" &&
      request.header("sec-fetch-mode") != "navigate") {
    return "pages from other sites may not use this server";
  }
  return "";
}

}  // namespace hapticd::server

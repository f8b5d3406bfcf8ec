#include "client/server_address.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include "wire/names.h"
#include "wire/text.h"

namespace hapticd::client {
namespace {

bool dropPrefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

std::uint16_t parsePort(std::string_view digits, std::string_view whole) {
  std::uint16_t port = 0;
  const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (error != std::errc{} || stop != digits.data() + digits.size() || port == 0) {
    throw std::invalid_argument("server " + wire::inQuotes(whole) + ": port " + wire::inQuotes(digits) +
                                ", expected 1 to 65535");
  }
  return port;
}

}  // namespace

ServerAddress parseServer(std::string_view text) {
  ServerAddress server;
  std::string_view rest = text;
  if (rest.starts_with("file:")) {
    throw std::invalid_argument(
        "server " + wire::inQuotes(text) +
        ": this library reads no files; open it with a client of VRPN, or connect to 'hapticd replay'");
  }
  if (dropPrefix(rest, "unix:")) {
    if (!rest.starts_with('/')) {
      throw std::invalid_argument("server " + wire::inQuotes(text) + ": expected unix:/path");
    }
    server.socket = rest;
    server.tcpOnly = true;
    return server;
  }
  server.tcpOnly = dropPrefix(rest, "tcp:");
  if (!server.tcpOnly) dropPrefix(rest, "x-vrpn:");
  dropPrefix(rest, "//");
  if (const std::size_t scheme = rest.find("://"); scheme != std::string_view::npos)
    throw std::invalid_argument(
        "server " + wire::inQuotes(text) +
        ": expected host, host:port or tcp://host:port; without tcp:// it is reached by UDP");
  if (rest.starts_with('[') || std::count(rest.begin(), rest.end(), ':') > 1)
    throw std::invalid_argument("server " + wire::inQuotes(text) +
                                ": IPv6 addresses are not supported; use a name or an IPv4 address");
  if (const std::size_t colon = rest.find(':'); colon != std::string_view::npos) {
    server.port = parsePort(rest.substr(colon + 1), text);
    rest = rest.substr(0, colon);
  }
  const auto allowed = [](char c) { return c > ' ' && c < 0x7f && c != '/' && c != '@'; };
  if (rest.empty() || rest.size() > 255 || !std::all_of(rest.begin(), rest.end(), allowed)) {
    throw std::invalid_argument("server " + wire::inQuotes(text) +
                                ": expected host, host:port or tcp://host:port");
  }
  server.host = rest;
  return server;
}

DeviceAddress parseDevice(std::string_view text) {
  const std::size_t at = text.find('@');
  if (at == std::string_view::npos || at == 0 || at > wire::kMaxNameBytes) {
    throw std::invalid_argument("device " + wire::inQuotes(text) +
                                ": expected NAME@host, NAME@host:port or NAME@tcp://host:port");
  }
  return {std::string(text.substr(0, at)), parseServer(text.substr(at + 1))};
}

}  // namespace hapticd::client

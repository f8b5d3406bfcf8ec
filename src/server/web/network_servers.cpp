#include "server/web/network_servers.h"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

namespace hapticd::server {
namespace {

using Json = nlohmann::ordered_json;

// Not within a character of UTF-8.
std::string shortened(const std::string& text) {
  if (text.size() <= kLongestServerText) return text;
  std::size_t end = kLongestServerText;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  return text.substr(0, end);
}

// What a click opens, or a client: whole or not at all.
bool isShort(std::string_view text) {
  return text.size() <= kLongestServerText;
}

std::string linkOf(const std::string& page) {
  const bool web = page.starts_with("http://") || page.starts_with("https://");
  return web && isShort(page) ? page : "";
}

Json json(const NetworkServer& server) {
  Json devices = Json::array();
  for (const std::string& device : server.devices) {
    if (devices.size() < kMostDevicesOfServer && isShort(device)) devices.push_back(device);
  }
  return {
      {"name", shortened(server.name)},       {"address", shortened(server.address)}, {"port", server.port},
      {"devices", std::move(devices)},        {"page", linkOf(server.page)},          {"tls", server.tls},
      {"version", shortened(server.version)}, {"this_server", server.thisServer}};
}

}  // namespace

std::string serversJson(NetworkSearch search) {
  // This server first, so that no crowd displaces it.
  const auto ours = std::find_if(search.servers.begin(), search.servers.end(),
                                 [](const NetworkServer& server) { return server.thisServer; });
  if (ours != search.servers.end()) std::rotate(search.servers.begin(), ours, std::next(ours));
  Json servers = Json::array();
  for (const NetworkServer& server : search.servers) {
    if (servers.size() < kMostServers) servers.push_back(json(server));
  }
  return Json{{"servers", std::move(servers)}, {"reason", search.reason}}.dump(
      -1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace hapticd::server

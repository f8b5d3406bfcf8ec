#include "announce.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

namespace hapticd::apps {

net::Endpoint reachedFromHere(net::Endpoint listening) {
  if (listening.address == net::kAnyAddress) listening.address = net::kLoopbackAddress;
  return listening;
}

void logAddresses(const server::Server& server, const server::ServerConfig& config, std::string_view driver) {
  const std::string at = server.address().text();
  spdlog::info("listening on {} (TCP and UDP)", at);
  if (!server.fingerprint().empty())
    spdlog::info("TLS{}; certificate SHA-256 {}", config.tlsLoopback ? "" : " for other machines",
                 server.fingerprint());
  for (const server::DeviceConfig& device : config.devices) {
    const std::string_view kind = driver.empty() ? device.driver : driver;
    for (const std::string& name : device.names) spdlog::info("device {}@{} ({})", name, at, kind);
  }
  if (const auto web = server.webAddress()) {
    const net::Endpoint page = reachedFromHere(*web);
    const bool secured =
        !server.fingerprint().empty() && (config.tlsLoopback || !net::isLoopback(page.address));
    spdlog::info("viewer: {}://{}/", secured ? "https" : "http", page.text());
  }
  if (const auto haply = server.haplyAddress())
    spdlog::info("programs for Haply devices: ws://{}", reachedFromHere(*haply).text());
}

std::unique_ptr<zeroconf::Announcer> announceOnNetwork(const server::Server& server,
                                                       const server::ServerConfig& config) {
  const net::Endpoint address = server.address();
  if (!config.announce || net::isLoopback(address.address)) return nullptr;
  std::array<char, 65> host{};  // HOST_NAME_MAX and a NUL
  ::gethostname(host.data(), host.size() - 1);
  zeroconf::AnnouncedServer announced{
      .name = std::string("hapticd on ") + host.data(),
      .port = address.port,
      .tls = !server.fingerprint().empty(),
      .version = HAPTICD_VERSION,
  };
  announced.name.resize(std::min(announced.name.size(), zeroconf::kLongestName));
  for (const server::DeviceConfig& device : config.devices)
    announced.devices.insert(announced.devices.end(), device.names.begin(), device.names.end());
  const auto web = server.webAddress();
  if (web && !net::isLoopback(web->address)) announced.pagePort = web->port;
  return std::make_unique<zeroconf::Announcer>(std::move(announced), address.address);
}

bool isReachedFromHereOnly(const server::Server& server) {
  const auto web = server.webAddress();
  return net::isLoopback(server.address().address) && (!web || net::isLoopback(web->address));
}

}  // namespace hapticd::apps

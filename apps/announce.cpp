#include "announce.h"

#include <spdlog/spdlog.h>

namespace hapticd::apps {

void announce(const server::Server& server, const server::ServerConfig& config, std::string_view driver) {
  const std::string at = server.address().text();
  spdlog::info("listening on {} (TCP and UDP)", at);
  if (!server.fingerprint().empty())
    spdlog::info("TLS for other machines; certificate SHA-256 {}", server.fingerprint());
  for (const server::DeviceConfig& device : config.devices) {
    const std::string_view kind = driver.empty() ? device.driver : driver;
    for (const std::string& name : device.names) spdlog::info("device {}@{} ({})", name, at, kind);
  }
  if (const auto web = server.webAddress()) {
    const bool everywhere = web->address == net::kAnyAddress;
    spdlog::info("viewer: http://{}:{}/", everywhere ? "127.0.0.1" : web->addressText(), web->port);
  }
}

}  // namespace hapticd::apps

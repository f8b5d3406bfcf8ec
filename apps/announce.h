// What a server says of itself at its start: in the log and on the network.
#pragma once

#include <memory>
#include <string_view>

#include "server/server.h"
#include "zeroconf/announcer.h"

namespace hapticd::apps {

/// Where programs on this machine reach what listens there: pages do not answer to the name 0.0.0.0.
net::Endpoint reachedFromHere(net::Endpoint listening);

/// Logs addresses, device names and the viewer's URL. `driver` replaces the drivers of the configuration, if
/// not empty.
void logAddresses(const server::Server& server, const server::ServerConfig& config,
                  std::string_view driver = {});

/// Announces the server on the network until the result is destroyed. None for a server that other machines
/// cannot reach or that shall not be announced.
std::unique_ptr<zeroconf::Announcer> announceOnNetwork(const server::Server& server,
                                                       const server::ServerConfig& config);

/// Whether neither its port nor its page can be reached from other machines.
bool isReachedFromHereOnly(const server::Server& server);

}  // namespace hapticd::apps

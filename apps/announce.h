// Logs the addresses, device names and viewer URL of a server at its start.
#pragma once

#include <string_view>

#include "server/server.h"

namespace hapticd::apps {

/// `driver` replaces the drivers of the configuration in the log, if not empty.
void announce(const server::Server& server, const server::ServerConfig& config, std::string_view driver = {});

}  // namespace hapticd::apps

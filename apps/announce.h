// What a server says at its start: where it listens, under which names, and where its page is.
#pragma once

#include <string_view>

#include "server/server.h"

namespace hapticd::apps {

/// Logs it; `driver` in place of those of the configuration, if given.
void announce(const server::Server& server, const server::ServerConfig& config, std::string_view driver = {});

}  // namespace hapticd::apps

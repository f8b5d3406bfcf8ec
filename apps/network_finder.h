// Finds the servers of the network for a server's page.
#pragma once

#include <memory>

#include "server/server.h"

namespace hapticd::apps {

/// Lets the page of the server list the servers of the network. Before its run().
void listNetworkOnPage(server::Server& server);

}  // namespace hapticd::apps

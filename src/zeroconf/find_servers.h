// Finds the servers that announce themselves on the network.
#pragma once

#include <vector>

#include "base/clock.h"
#include "base/time.h"
#include "zeroconf/announced_server.h"

namespace hapticd::zeroconf {

/// All servers that answer within `patience`, by name; returns earlier when Avahi has heard all it knows, as
/// a rule after 1 s. Blocks. Throws std::runtime_error, with the remedy, when there is no Avahi.
std::vector<AnnouncedServer> findServers(base::Clock& clock, base::Nanos patience);

}  // namespace hapticd::zeroconf

// Finds the servers that announce themselves on the network.
#pragma once

#include <vector>

#include "base/clock.h"
#include "base/time.h"
#include "net/endpoint.h"
#include "zeroconf/announced_server.h"

namespace hapticd::zeroconf {

/// All servers that answer within `patience`, by name; returns earlier when Avahi has heard all it knows, as
/// a rule after 1 s, or when `stopFd` (-1: none) is readable. Blocks. Throws std::runtime_error, with the
/// remedy, when there is no Avahi.
std::vector<AnnouncedServer> findServers(base::Clock& clock, base::Nanos patience, int stopFd = -1);

/// Whether a server that listens at `listening` is the one that was found.
bool listensAt(const net::Endpoint& listening, const AnnouncedServer& found);

}  // namespace hapticd::zeroconf

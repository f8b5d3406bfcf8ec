// Finds a server on the network for commands that were given none.
#pragma once

#include <string>

namespace hapticd::apps {

/// The device of the only server that announces itself on the network, as a client opens it:
/// "Phantom@192.168.1.7:3883". Takes up to 3 s. Throws std::runtime_error, with the choice, when there is
/// none or more than one.
std::string onlyDeviceOfNetwork();

}  // namespace hapticd::apps

// The network interfaces of this machine.
#pragma once

#include <cstdint>

namespace hapticd::zeroconf {

/// Index of the interface with this address (host byte order); kAnyInterface when none has it, and for
/// net::kAnyAddress.
int interfaceWith(std::uint32_t address);

}  // namespace hapticd::zeroconf

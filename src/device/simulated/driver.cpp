#include <cstdio>

#include "device/driver.h"
#include "device/simulated/hand_file.h"
#include "device/simulated/simulated_device.h"

namespace hapticd::device::drivers_in_this_build {

extern const Driver simulated;
const Driver simulated{.name = "simulated",
                       .help = "a simulated hand: no hardware needed",
                       .keys = {},
                       .hasHardware = false,
                       .hasHand = true,
                       .canBeIsolated = false,
                       .make = [](const DriverOptions& options) -> std::unique_ptr<Device> {
                         auto device = std::make_unique<SimulatedDevice>();
                         if (options.hand == "script") return device;
                         const auto hand = HandFile::load(options.hand);
                         if (!hand->remark().empty())
                           std::fprintf(stderr, "%s: %s\n", options.hand.c_str(), hand->remark().c_str());
                         device->setPath(hand);
                         return device;
                       }};

}  // namespace hapticd::device::drivers_in_this_build

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
                         if (options.hand == "script") return std::make_unique<SimulatedDevice>();
                         const auto hand = HandFile::load(options.hand);
                         SimulatedOptions withRemark;
                         if (!hand->remark().empty())
                           withRemark.remark = options.hand + ": " + hand->remark();
                         auto device = std::make_unique<SimulatedDevice>(withRemark);
                         device->setPath(hand);
                         return device;
                       }};

}  // namespace hapticd::device::drivers_in_this_build

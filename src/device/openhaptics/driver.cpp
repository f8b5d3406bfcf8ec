#include "device/driver.h"
#include "device/openhaptics/openhaptics_device.h"

namespace hapticd::device::drivers_in_this_build {

extern const Driver openhaptics;
const Driver openhaptics{
    .name = "openhaptics",
    .help = "3D Systems Touch, Touch X and Phantom, through OpenHaptics",
    .keys = {},
    .isolatedByDefault = true,  // HDAPI has no watchdog
    .make = [](const DriverOptions& options) -> std::unique_ptr<Device> {
      return std::make_unique<OpenHapticsDevice>(OpenHapticsOptions{
          .name = options.hardware, .rate_Hz = options.servoRate_Hz, .calibrate = options.calibrate});
    }};

}  // namespace hapticd::device::drivers_in_this_build

// The drivers by name.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "device/device.h"
#include "server/config.h"

namespace hapticd::server {

/// Names for --device, in the order of the help.
std::vector<std::string> driverNames();

/// Makes the device of a configuration, not yet opened. Throws ConfigError for an unknown driver.
std::unique_ptr<device::Device> makeDevice(const DeviceConfig& config);

}  // namespace hapticd::server

// The drivers by name.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "device/device.h"
#include "server/config/config.h"

namespace hapticd::server {

/// Names for --device, in the order of the help.
std::vector<std::string> driverNames();

/// Makes the device of a configuration, not yet opened; an isolated one when so configured. Throws ConfigError
/// for an unknown driver.
std::unique_ptr<device::Device> makeDevice(const DeviceConfig& config);

/// The subcommand of hapticd that is the whole life of an isolated driver's process; its one argument is the
/// configuration as TOML.
inline constexpr const char* kDeviceHostCommand = "device-host";

}  // namespace hapticd::server

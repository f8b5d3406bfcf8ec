// The device of a configuration.
#pragma once

#include <memory>

#include "device/device.h"
#include "server/config/config.h"

namespace hapticd::server {

/// Makes the device of a configuration, not yet open, in a process of its own if configured so. Throws ConfigError for
/// an unknown driver or a value that the driver does not accept.
std::unique_ptr<device::Device> makeDevice(const DeviceConfig& config);

/// The subcommand of hapticd that an isolated driver's process runs; its one argument is the configuration as TOML.
inline constexpr const char* kDeviceHostCommand = "device-host";

}  // namespace hapticd::server

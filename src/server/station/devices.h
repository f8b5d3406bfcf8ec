// Makes devices from their configuration.
#pragma once

#include <memory>

#include "device/device.h"
#include "server/config/config.h"

namespace hapticd::server {

/// Makes the configured device, not yet open; in an isolation host if configured so. Throws ConfigError for
/// an unknown driver or a value that the driver does not accept.
std::unique_ptr<device::Device> makeDevice(const DeviceConfig& config);

/// The subcommand of hapticd that an isolation host runs; its only argument is the configuration as TOML.
inline constexpr const char* kDeviceHostCommand = "device-host";

}  // namespace hapticd::server

// Reads vrpn.cfg, the configuration file of stock VRPN servers: one line for each device.
#pragma once

#include <string>
#include <vector>

#include "server/config/config.h"

namespace hapticd::server {

/// Reads the lines
///
///     vrpn_OpenHaptics NAME reset_position(0|1) report_rate_Hz linear_tolerance_mm angular_tolerance_rad
///     DEVICE vrpn_Phantom NAME calibrate(0|1) report_rate_Hz DEVICE
///
/// DEVICE is the rest of the line, spaces included; without it the first device is used. Trailing numbers may
/// be omitted. Both kinds become devices of the driver "openhaptics"; vrpn_OpenHaptics fits scenes to the
/// paper's workspace. Comments (#) and empty lines are ignored; lines of other devices are skipped with a
/// text in `warnings`. Throws ConfigError that names `source` and the line.
ServerConfig parseVrpnCfg(const std::string& text, const std::string& source,
                          std::vector<std::string>& warnings);

}  // namespace hapticd::server

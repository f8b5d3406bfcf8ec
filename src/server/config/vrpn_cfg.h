// The configuration file of VRPN servers, as it stands: one line for each device.
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
/// DEVICE is the rest of the line, spaces included; without it the first device is meant. Numbers may be left
/// out from the end. Both become devices of the driver "openhaptics"; the first kind fits scenes to the
/// paper's workspace. Comments (#) and empty lines are passed over; lines of other devices are named in
/// `remarks` and left out. Throws ConfigError, which names `source` and the line.
ServerConfig parseVrpnCfg(const std::string& text, const std::string& source,
                          std::vector<std::string>& remarks);

}  // namespace hapticd::server

// Prints found devices, for 'devices' and 'doctor'.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "device/discovery/discovery.h"

namespace hapticd::apps {

/// Prints one paragraph for each driver.
void printDevices(const std::vector<device::DriverReport>& reports);
/// A list with one object for each driver.
nlohmann::json jsonOf(const std::vector<device::DriverReport>& reports);

}  // namespace hapticd::apps

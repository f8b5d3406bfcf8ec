// Every driver of this build, by name.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "device/driver.h"

namespace hapticd::device {

/// In the order of src/device/CMakeLists.txt; the first one is the default.
std::span<const Driver* const> drivers() noexcept;
/// Null when no driver has this name.
const Driver* findDriver(std::string_view name) noexcept;
/// "simulated, openhaptics, ...".
std::string driverNames();
/// The keys of all drivers, each once, in the order of drivers().
const std::vector<std::string>& driverKeys();

}  // namespace hapticd::device

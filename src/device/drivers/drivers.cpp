#include "device/drivers/drivers.h"

#include <algorithm>

namespace hapticd::device {

// driver_list.inc, which CMake writes, has one line HAPTICD_DRIVER(folder) for each driver.
namespace drivers_in_this_build {
#define HAPTICD_DRIVER(name) extern const Driver name;
#include "driver_list.inc"
#undef HAPTICD_DRIVER
}  // namespace drivers_in_this_build

std::span<const Driver* const> drivers() noexcept {
#define HAPTICD_DRIVER(name) &drivers_in_this_build::name,
  static constexpr const Driver* kDrivers[] = {
#include "driver_list.inc"
  };
#undef HAPTICD_DRIVER
  return kDrivers;
}

const Driver* findDriver(std::string_view name) noexcept {
  const auto all = drivers();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Driver* driver) { return driver->name == name; });
  return found == all.end() ? nullptr : *found;
}

std::string driverNames() {
  std::string names;
  for (const Driver* driver : drivers()) names += (names.empty() ? "" : ", ") + std::string(driver->name);
  return names;
}

const std::vector<std::string>& driverKeys() {
  static const std::vector<std::string> keys = [] {
    std::vector<std::string> all;
    for (const Driver* driver : drivers()) {
      for (const char* key : driver->keys) {
        if (std::find(all.begin(), all.end(), key) == all.end()) all.emplace_back(key);
      }
    }
    return all;
  }();
  return keys;
}

}  // namespace hapticd::device

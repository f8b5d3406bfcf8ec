// The names of drivers for the configuration, without the drivers: the fuzzers do not link half of the
// server.
#include <algorithm>

#include "device/drivers/drivers.h"

namespace hapticd::device {
namespace {

constexpr const char* kKeys[] = {"host", "port"};
const Driver kSimulated{.name = "simulated", .help = "", .keys = {}, .make = nullptr};
const Driver kOther{.name = "other", .help = "", .keys = kKeys, .make = nullptr};
const Driver* const kDrivers[] = {&kSimulated, &kOther};

}  // namespace

std::span<const Driver* const> drivers() noexcept {
  return kDrivers;
}

const Driver* findDriver(std::string_view name) noexcept {
  const auto found = std::find_if(std::begin(kDrivers), std::end(kDrivers),
                                  [&](const Driver* d) { return d->name == name; });
  return found == std::end(kDrivers) ? nullptr : *found;
}

std::string driverNames() {
  return "simulated, other";
}

const std::vector<std::string>& driverKeys() {
  static const std::vector<std::string> keys{kKeys[0], kKeys[1]};
  return keys;
}

}  // namespace hapticd::device

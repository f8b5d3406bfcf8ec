#include "device/driver.h"

#include <charconv>

#include "device/force_dimension/force_dimension_device.h"

namespace hapticd::device::drivers_in_this_build {
namespace {

std::unique_ptr<Device> make(const DriverOptions& options) {
  ForceDimensionOptions own;
  if (!options.hardware.empty()) {
    const char* end = options.hardware.data() + options.hardware.size();
    if (std::from_chars(options.hardware.data(), end, own.index).ptr != end) {
      throw InvalidDriverOption("hardware is '" + options.hardware +
                                "', expected the number of the Force Dimension device, 0 for the first");
    }
  }
  return std::make_unique<ForceDimensionDevice>(own);
}

}  // namespace

extern const Driver force_dimension;
const Driver force_dimension{.name = "forcedimension",
                             .help = "Force Dimension omega, delta, sigma and lambda",
                             .keys = {},
                             .make = make};

}  // namespace hapticd::device::drivers_in_this_build

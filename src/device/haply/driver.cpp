#include "device/driver.h"
#include "device/haply/haply_device.h"

namespace hapticd::device::drivers_in_this_build {
namespace {

// [HOST:PORT/]ID; each part may stand alone.
std::unique_ptr<Device> make(const DriverOptions& options) {
  HaplyOptions own;
  const std::size_t slash = options.hardware.find('/');
  const std::string place = options.hardware.substr(0, slash);
  const std::size_t colon = place.rfind(':');
  if (colon != std::string::npos) {
    own.host = place.substr(0, colon);
    own.port = place.substr(colon + 1);
    own.deviceId = slash == std::string::npos ? "" : options.hardware.substr(slash + 1);
  } else {
    own.deviceId = options.hardware;
  }
  return std::make_unique<HaplyDevice>(own);
}

}  // namespace

extern const Driver haply;
const Driver haply{.name = "haply",
                   .help = "Haply Inverse3 and Minverse, through the Inverse Service",
                   .keys = {},
                   .make = make};

}  // namespace hapticd::device::drivers_in_this_build

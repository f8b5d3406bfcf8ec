#include "device/driver.h"
#include "device/haply/haply_device.h"

namespace hapticd::device::drivers_in_this_build {
namespace {

// [HOST:PORT/]ID; each part may stand alone.
HaplyOptions optionsOf(const std::string& hardware) {
  HaplyOptions own;
  const std::size_t slash = hardware.find('/');
  const std::string place = hardware.substr(0, slash);
  const std::size_t colon = place.rfind(':');
  if (colon != std::string::npos) {
    own.host = place.substr(0, colon);
    own.port = place.substr(colon + 1);
    own.deviceId = slash == std::string::npos ? "" : hardware.substr(slash + 1);
  } else {
    own.deviceId = hardware;
  }
  return own;
}

std::unique_ptr<Device> make(const DriverOptions& options) {
  return std::make_unique<HaplyDevice>(optionsOf(options.hardware));
}

std::string service(const std::string& hardware) {
  const HaplyOptions options = optionsOf(hardware);
  return options.host + ":" + options.port;
}

}  // namespace

extern const Driver haply;
const Driver haply{.name = "haply",
                   .help = "Haply Inverse3 and Minverse, through the Inverse Service",
                   .keys = {},
                   .make = make,
                   .service = service};

}  // namespace hapticd::device::drivers_in_this_build

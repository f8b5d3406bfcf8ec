#include "device/driver.h"
#include "device/evdev/evdev_device.h"

namespace hapticd::device::drivers_in_this_build {
namespace {

constexpr const char* kWheelProfile = "wheel_profile";
constexpr const char* kKeys[] = {kWheelProfile};

std::unique_ptr<Device> make(const DriverOptions& options) {
  const auto profile = options.keys.find(kWheelProfile);
  return std::make_unique<EvdevDevice>(EvdevOptions{
      .path = options.hardware, .profile = profile == options.keys.end() ? "" : profile->second});
}

}  // namespace

extern const Driver evdev;
const Driver evdev{
    .name = "evdev", .help = "force-feedback joysticks and wheels of Linux", .keys = kKeys, .make = make};

}  // namespace hapticd::device::drivers_in_this_build

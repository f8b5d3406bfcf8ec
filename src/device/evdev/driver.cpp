#include "device/driver.h"
#include "device/evdev/evdev_device.h"

namespace hapticd::device::drivers_in_this_build {
namespace {

constexpr const char* kWheelProfile = "wheel_profile";
constexpr const char* kKeys[] = {kWheelProfile};

std::unique_ptr<Device> make(const DriverOptions& options) {
  const auto given = options.keys.find(kWheelProfile);
  const std::string profile = given == options.keys.end() ? "" : given->second;
  try {
    // open() reads it; a mistake in it is reported before a device is there.
    if (!profile.empty()) WheelProfile::load(profile);
  } catch (const WheelProfileError& error) {
    throw InvalidDriverOption(std::string(kWheelProfile) + ": " + error.what());
  }
  return std::make_unique<EvdevDevice>(EvdevOptions{.path = options.hardware, .profile = profile});
}

}  // namespace

extern const Driver evdev;
const Driver evdev{
    .name = "evdev", .help = "force-feedback joysticks and wheels of Linux", .keys = kKeys, .make = make};

}  // namespace hapticd::device::drivers_in_this_build

#include "server/station/devices.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "base/thread.h"
#include "device/drivers/drivers.h"
#include "device/isolation/isolated_device.h"

namespace hapticd::server {
namespace {

// The isolation host runs this program for one device.
std::unique_ptr<device::Device> isolated(DeviceConfig config) {
  constexpr unsigned kFewest = 4;  // the servo takes up to a third of one
  bool watches = std::exchange(config.isolateWatch, false);
  if (watches && base::processors() < kFewest) {
    spdlog::warn("device '{}': isolate_watch has no effect with fewer than {} processors; there are {}",
                 config.names.front(), kFewest, base::processors());
    watches = false;
  }
  config.isolate = false;
  ServerConfig all;
  all.devices = {std::move(config)};
  return std::make_unique<device::IsolatedDevice>(device::IsolatedOptions{
      .command = {"/proc/self/exe", kDeviceHostCommand, toToml(all)}, .watches = watches});
}

}  // namespace

std::unique_ptr<device::Device> makeDevice(const DeviceConfig& config) {
  const std::string prefix = "device '" + config.names.front() + "': ";
  const device::Driver* const driver = device::findDriver(config.driver);
  if (driver == nullptr) {
    throw ConfigError(prefix + "unknown driver '" + config.driver + "'; available: " + device::driverNames());
  }
  if (config.isolate.value_or(driver->isolatedByDefault)) return isolated(config);
  try {
    return driver->make({.hardware = config.hardware,
                         .hand = config.hand,
                         .servoRate_Hz = config.servoRate_Hz,
                         .calibrate = config.calibrate,
                         .keys = config.driverKeys});
  } catch (const device::InvalidDriverOption& error) {
    throw ConfigError(prefix + error.what());
  }
}

}  // namespace hapticd::server

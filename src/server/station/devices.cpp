#include "server/station/devices.h"

#include <charconv>
#include <functional>

#include "device/evdev/evdev_device.h"
#include "device/force_dimension/force_dimension_device.h"
#include "device/haply/haply_device.h"
#include "device/isolation/isolated_device.h"
#include "device/openhaptics/openhaptics_device.h"
#include "device/replay/replay_device.h"
#include "device/simulated/simulated_device.h"

namespace hapticd::server {
namespace {

using DevicePtr = std::unique_ptr<device::Device>;

DevicePtr simulated(const DeviceConfig&) {
  return std::make_unique<device::SimulatedDevice>();
}

DevicePtr openHaptics(const DeviceConfig& config) {
  return std::make_unique<device::OpenHapticsDevice>(device::OpenHapticsOptions{
      .name = config.hardware, .rate_Hz = config.servoRate_Hz, .calibrate = config.calibrate});
}

DevicePtr forceDimension(const DeviceConfig& config) {
  device::ForceDimensionOptions options;
  if (!config.hardware.empty()) {
    const char* end = config.hardware.data() + config.hardware.size();
    if (std::from_chars(config.hardware.data(), end, options.index).ptr != end) {
      throw ConfigError("device '" + config.names.front() + "': hardware is '" + config.hardware +
                        "', expected the number of the Force Dimension device, 0 for the first");
    }
  }
  return std::make_unique<device::ForceDimensionDevice>(options);
}

DevicePtr haply(const DeviceConfig& config) {
  // [HOST:PORT/]ID, each part alone, too.
  device::HaplyOptions options;
  const std::size_t slash = config.hardware.find('/');
  const std::string place = config.hardware.substr(0, slash);
  const std::size_t colon = place.rfind(':');
  if (colon != std::string::npos) {
    options.host = place.substr(0, colon);
    options.port = place.substr(colon + 1);
    options.deviceId = slash == std::string::npos ? "" : config.hardware.substr(slash + 1);
  } else {
    options.deviceId = config.hardware;
  }
  return std::make_unique<device::HaplyDevice>(options);
}

DevicePtr evdev(const DeviceConfig& config) {
  return std::make_unique<device::EvdevDevice>(
      device::EvdevOptions{.path = config.hardware, .profile = config.wheelProfile});
}

DevicePtr replay(const DeviceConfig& config) {
  if (config.hand == "script") {
    throw ConfigError("device '" + config.names.front() + "': replay needs a recorded hand: --hand FILE.csv");
  }
  device::ReplayOptions options;
  options.file = config.hand;
  options.repeat = true;
  return std::make_unique<device::ReplayDevice>(options);
}

// This program again, for one device alone.
DevicePtr isolated(DeviceConfig config) {
  config.isolate = false;
  ServerConfig all;
  all.devices = {std::move(config)};
  return std::make_unique<device::IsolatedDevice>(
      device::IsolatedOptions{.command = {"/proc/self/exe", kDeviceHostCommand, toToml(all)}});
}

struct Driver {
  const char* name;
  DevicePtr (*make)(const DeviceConfig&);
};

constexpr Driver kDrivers[] = {{"simulated", simulated},
                               {"openhaptics", openHaptics},
                               {"forcedimension", forceDimension},
                               {"haply", haply},
                               {"evdev", evdev},
                               {"replay", replay}};

}  // namespace

std::vector<std::string> driverNames() {
  std::vector<std::string> names;
  for (const Driver& driver : kDrivers) names.emplace_back(driver.name);
  return names;
}

std::unique_ptr<device::Device> makeDevice(const DeviceConfig& config) {
  std::string known;
  for (const Driver& driver : kDrivers) {
    if (config.driver == driver.name) return config.isolate ? isolated(config) : driver.make(config);
    known += (known.empty() ? "" : ", ") + std::string(driver.name);
  }
  throw ConfigError("device '" + config.names.front() + "': no driver is called '" + config.driver +
                    "'; there is " + known);
}

}  // namespace hapticd::server

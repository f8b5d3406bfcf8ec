#include "server/devices.h"

#include "device/simulated/simulated_device.h"

namespace hapticd::server {

std::vector<std::string> driverNames() {
  return {"simulated"};
}

std::unique_ptr<device::Device> makeDevice(const DeviceConfig& config) {
  if (config.driver == "simulated") return std::make_unique<device::SimulatedDevice>();
  std::string known;
  for (const std::string& name : driverNames()) known += (known.empty() ? "" : ", ") + name;
  throw ConfigError("device '" + config.names.front() + "': no driver is called '" + config.driver +
                    "'; there is " + known);
}

}  // namespace hapticd::server

// hapticd device-host: runs one driver in its own process (the isolation host). Started by the server, not by
// people.
#include <exception>
#include <memory>
#include <string>

#include "commands.h"
#include "device/isolation/device_host.h"
#include "realtime/servo/thread_setup.h"
#include "server/station/devices.h"

namespace hapticd::apps {

void addDeviceHost(CLI::App& app) {
  auto text = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(server::kDeviceHostCommand,
                                         "Run one driver in its own process; started by the server");
  command->group("");  // hidden from the help
  command->add_option("config", *text, "Configuration with exactly one device, as TOML")->required();
  command->callback([text] {
    const server::DeviceConfig config = server::parseConfig(*text, "configuration").devices.front();
    std::unique_ptr<device::Device> device;
    try {
      device = server::makeDevice(config);
    } catch (const std::exception& error) {  // a file that the server has read may have changed since
      exitCode = device::refuseDeviceHost(error.what());
      return;
    }
    realtime::setUpThread({.realtime = false});  // locks the memory of the process
    exitCode = device::runDeviceHost(
        *device,
        {.rate_Hz = config.servoRate_Hz, .beforeFirstTick = [vendors = device->traits().ticksInVendorThread] {
           realtime::setUpThread({.keepScheduling = vendors, .lockMemory = false});
         }});
  });
}

}  // namespace hapticd::apps

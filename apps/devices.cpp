// hapticd devices: what can be touched with on this machine, and why the rest cannot.
#include <cstdio>
#include <memory>

#include "commands.h"
#include "device_list.h"

namespace hapticd::apps {

void printDevices(const std::vector<device::DriverReport>& reports) {
  for (const device::DriverReport& report : reports) {
    std::printf("%s\n", report.driver.c_str());
    for (const std::string& found : report.devices) std::printf("  found    %s\n", found.c_str());
    if (!report.reason.empty()) std::printf("  missing  %s\n", report.reason.c_str());
    if (!report.remedy.empty()) std::printf("  remedy   %s\n", report.remedy.c_str());
  }
  std::printf("simulated\n  found    a hand made of arithmetic, always there\n");
}

void addDevices(CLI::App& app) {
  auto options = std::make_shared<device::DiscoveryOptions>();
  CLI::App* command =
      app.add_subcommand("devices", "List the haptic devices found, and why others cannot be used");
  command->add_flag(
      "--open", options->openThem,
      "Also open, without force, what shows itself in no other way (takes the device for a moment)");
  command->add_option("--haply-host", options->haplyHost, "Where the Haply service runs")
      ->capture_default_str();
  command->add_option("--haply-port", options->haplyPort, "Its port")->capture_default_str();
  command->footer("'hapticd serve --device DRIVER' uses one; udev rules are in packaging/udev.");
  command->callback([options] { printDevices(device::findDevices(*options)); });
}

}  // namespace hapticd::apps

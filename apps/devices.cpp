// hapticd devices: lists the haptic devices of this machine, and the reason and remedy for drivers without
// one.
#include <cstdio>
#include <memory>

#include "commands.h"
#include "device_list.h"
#include "print_json.h"

namespace hapticd::apps {

void printDevices(const std::vector<device::DriverReport>& reports) {
  for (const device::DriverReport& report : reports) {
    std::printf("%s\n", report.driver.c_str());
    for (const std::string& found : report.devices) std::printf("  found    %s\n", found.c_str());
    if (!report.reason.empty()) std::printf("  missing  %s\n", report.reason.c_str());
    if (!report.remedy.empty()) std::printf("  remedy   %s\n", report.remedy.c_str());
  }
  std::printf("simulated\n  found    a simulated hand, always available\n");
}

nlohmann::json jsonOf(const std::vector<device::DriverReport>& reports) {
  nlohmann::json drivers = nlohmann::json::array();
  for (const device::DriverReport& report : reports) {
    drivers.push_back({{"driver", report.driver},
                       {"found", report.devices},
                       {"missing", report.reason},
                       {"remedy", report.remedy}});
  }
  drivers.push_back(
      {{"driver", "simulated"}, {"found", {"a simulated hand"}}, {"missing", ""}, {"remedy", ""}});
  return drivers;
}

void addDevices(CLI::App& app) {
  auto options = std::make_shared<device::DiscoveryOptions>();
  auto json = std::make_shared<bool>(false);
  CLI::App* command =
      app.add_subcommand("devices", "List the haptic devices found, and why others cannot be used");
  command->add_flag(
      "--open", options->openThem,
      "Also open devices that can be detected in no other way, without force (occupies the device briefly)");
  command->add_option("--haply-host", options->haplyHost, "Host of the Haply service")
      ->check(notEmpty())
      ->capture_default_str();
  command->add_option("--haply-port", options->haplyPort, "Port of the Haply service")
      ->check(withinIntegers(1, 65535))
      ->capture_default_str();
  command->add_flag("--json", *json, kJsonText);
  command->footer(
      "'hapticd serve --device DRIVER' uses a device. The package installs the udev rules;\n"
      "a build from source has them in packaging/udev.");
  command->callback([options, json] {
    const std::vector<device::DriverReport> reports = device::findDevices(*options);
    if (*json) {
      printJson(jsonOf(reports));
    } else {
      printDevices(reports);
    }
  });
}

}  // namespace hapticd::apps

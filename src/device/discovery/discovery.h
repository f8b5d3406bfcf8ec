// Devices connected to this machine, and why others cannot be used: for `hapticd devices`.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <system_error>
#include <vector>

namespace hapticd::device {

/// The findings of one driver: devices, or a reason and a remedy, or both when only some devices can be used.
struct DriverReport {
  std::string driver;  ///< its name in the configuration
  std::vector<std::string>
      devices;         ///< descriptions; openhaptics reports as unknown what only opening could show
  std::string reason;  ///< why there is none: the message of the loader, the system or the service
  std::string remedy;  ///< what to install, connect or allow
};

/// No error, or the system's.
std::error_code mayReadAndWrite(const std::filesystem::path& node);

struct DiscoveryOptions {
  bool openThem = false;  ///< also opens devices, without force, where nothing else identifies them; occupies
                          ///< each briefly
  std::string haplyHost = "localhost";
  std::string haplyPort = "10001";
  std::filesystem::path usbDevices = "/sys/bus/usb/devices";
  std::filesystem::path inputDevices = "/sys/class/input";
  std::filesystem::path nodes = "/dev";
  /// Whether this user may read and write a node.
  std::function<std::error_code(const std::filesystem::path&)> mayUse = mayReadAndWrite;
};

/// Searches for the devices of every driver. Blocks for a second or two; missing devices never throw.
std::vector<DriverReport> findDevices(const DiscoveryOptions& options = {});

}  // namespace hapticd::device

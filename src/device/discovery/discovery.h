// What is connected to this machine, and why the rest cannot be used: for `hapticd devices`.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <system_error>
#include <vector>

namespace hapticd::device {

/// What one driver finds. Either devices, or a reason and a remedy; both when some can be used and some not.
struct DriverReport {
  std::string driver;  ///< its name in the configuration
  std::vector<std::string>
      devices;         ///< in words; what openhaptics can see only by opening is said to be unknown
  std::string reason;  ///< why there is none, in the words of the loader, the system or the service
  std::string remedy;  ///< what to install, connect or allow
};

/// No error, or the system's.
std::error_code mayReadAndWrite(const std::filesystem::path& node);

struct DiscoveryOptions {
  bool openThem =
      false;  ///< also opens, without force, where nothing else tells: takes the device for a moment
  std::string haplyHost = "localhost";
  std::string haplyPort = "10001";
  std::filesystem::path usbDevices = "/sys/bus/usb/devices";
  std::filesystem::path inputDevices = "/sys/class/input";
  std::filesystem::path nodes = "/dev";
  /// Whether this user may read and write a node.
  std::function<std::error_code(const std::filesystem::path&)> mayUse = mayReadAndWrite;
};

/// Asks every driver for real devices. Blocks for a second or two; never throws for what it does not find.
std::vector<DriverReport> findDevices(const DiscoveryOptions& options = {});

}  // namespace hapticd::device

// A driver as the configuration and the server see it, before it makes a device.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>

#include "device/device.h"

namespace hapticd::device {

/// The configuration of one device, as its driver sees it.
struct DriverOptions {
  std::string hardware = {};    ///< which device, in the words of the driver; empty: the first one
  std::string hand = "script";  ///< of devices without a person: "script", or a CSV file with the path
  double servoRate_Hz = 1000;
  bool calibrate = false;                        ///< consent to calibrate; may move the arm
  std::map<std::string, std::string> keys = {};  ///< values of Driver::keys
};

/// A value that the driver does not accept; what() names the key, the value and the remedy.
class InvalidDriverOption : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A driver: one constant of this type in the folder of each, listed in src/device/CMakeLists.txt.
struct Driver {
  const char* name;  ///< for --device and the key `driver`
  const char* help;  ///< one line: which devices it runs
  std::span<const char* const>
      keys;                   ///< keys of a [[device]] that only this driver reads; their values are texts
  bool hasHardware = true;    ///< reads DriverOptions::hardware
  bool hasHand = false;       ///< reads DriverOptions::hand
  bool canBeIsolated = true;  ///< may run in a process of its own
  /// Does so unless configured otherwise: a vendor's library whose last force nothing ends when the process
  /// hangs or dies.
  bool isolatedByDefault = false;
  /// Makes a device, not yet open. Throws InvalidDriverOption, or std::runtime_error for a file that it
  /// cannot read.
  std::unique_ptr<Device> (*make)(const DriverOptions& options);
  /// HOST:PORT of the service that a device with this `hardware` is reached through; null when none is.
  std::string (*service)(const std::string& hardware) = nullptr;
};

}  // namespace hapticd::device

// The whole life of a driver's own process.
#pragma once

#include <functional>
#include <string>

#include "device/device.h"

namespace hapticd::device {

struct DeviceHostOptions {
  double rate_Hz = 1000;                       ///< of the loop of a device that does not pace itself
  std::function<void()> beforeFirstTick = {};  ///< in the thread of the loop, whoever owns it
};

/// Serves this device, not yet open, to the IsolatedDevice that started the process, until that goes away;
/// leaves no force behind. The result is for main() to return.
int runDeviceHost(Device& device, const DeviceHostOptions& options = {});

/// In its place where there is no device to serve: tells the IsolatedDevice why.
int refuseDeviceHost(const std::string& reason);

}  // namespace hapticd::device

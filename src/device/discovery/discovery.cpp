#include "device/discovery/discovery.h"

#include <chrono>
#include <exception>

#include "device/discovery/usb_devices.h"
#include "device/evdev/evdev_device.h"
#include "device/force_dimension/dhd_api.h"
#include "device/haply/haply_messages.h"
#include "device/haply/service_connection.h"
#include "device/openhaptics/openhaptics_device.h"

namespace hapticd::device {
namespace {

constexpr const char* kUdev =
    "sudo cp packaging/udev/70-hapticd.rules /etc/udev/rules.d/ && sudo udevadm control --reload && "
    "sudo udevadm trigger";

std::string pluggedIn(const std::vector<UsbDevice>& devices) {
  std::string words;
  for (const UsbDevice& device : devices) words += device.text() + " is plugged in; ";
  return words;
}

DriverReport findOpenHaptics(const DiscoveryOptions& options) {
  DriverReport report{"openhaptics", {}, {}, {}};
  const std::vector<UsbDevice> usb = findUsbDevices(options.usbDevices, {"2988", "0301"});
  try {
    hd::Session::get();
  } catch (const LibraryError& error) {
    report.reason = pluggedIn(usb) + error.what();
    report.remedy =
        "install the Touch device driver and OpenHaptics of 3D Systems, and the library that the reason "
        "names";
    return report;
  }
  if (!options.openThem) {
    for (const UsbDevice& device : usb) report.devices.push_back(device.text());
    if (usb.empty())
      report.reason = "the library is there; only opening a device shows whether one is connected";
    return report;
  }
  try {
    OpenHapticsDevice device;
    device.open();
    report.devices.push_back(device.description());
  } catch (const std::exception& error) {
    report.reason = pluggedIn(usb) + error.what();
    report.remedy = "run the vendor's setup tool once, as it names the device; for a USB device also: " +
                    std::string(kUdev);
  }
  return report;
}

DriverReport findForceDimension(const DiscoveryOptions& options) {
  DriverReport report{"forcedimension", {}, {}, {}};
  const std::vector<UsbDevice> usb = findUsbDevices(options.usbDevices, {"1451"});
  try {
    const dhd::Api api{DynamicLibrary(dhd::libraryNames())};
    const int count = api.getDeviceCount();
    for (int i = 0; i < count; ++i) report.devices.push_back("device " + std::to_string(i));
    if (count > 0) return report;
    report.reason = pluggedIn(usb) + "the library finds no device";
    report.remedy =
        usb.empty() ? "connect the device and switch it on" : kUdev + std::string("; then plug it in again");
  } catch (const LibraryError& error) {
    report.reason = pluggedIn(usb) + error.what();
    report.remedy = "install the SDK of Force Dimension (libdrd.so.3), and libusb-1.0";
  }
  return report;
}

DriverReport findHaply(const DiscoveryOptions& options) {
  using namespace std::chrono_literals;
  DriverReport report{"haply", {}, {}, {}};
  try {
    haply::ServiceConnection service(options.haplyHost, options.haplyPort, 1000ms);
    const auto message = haply::parseMessage(service.receive(1000ms), {});
    if (message) {
      report.devices.push_back("Inverse3 '" + message->deviceId + "'");
      return report;
    }
    report.reason = "the service knows no Inverse3";
    report.remedy = "connect the device and switch it on";
  } catch (const std::exception& error) {
    report.reason = error.what();
    report.remedy =
        "install the Haply Inverse Service, then: sudo systemctl enable --now haply-inverse-service";
  }
  return report;
}

DriverReport findEvdev() {
  DriverReport report{"evdev", {}, {}, {}};
  const std::vector<std::string> paths = eventDevicePaths();
  for (const std::string& path : paths) {
    try {
      report.devices.push_back(path + ": " + EvdevDevice::probe(path));
    } catch (const NoForceFeedback&) {
      // A keyboard.
    } catch (const std::exception& error) {
      report.reason += (report.reason.empty() ? "" : "; ") + std::string(error.what());
      report.remedy = kUdev;
    }
  }
  if (report.devices.empty() && report.reason.empty()) {
    report.reason =
        paths.empty() ? "there is no /dev/input/event*" : "no input device here has force feedback";
    report.remedy = "connect a joystick or wheel that Linux supports with force feedback";
  }
  return report;
}

}  // namespace

std::vector<DriverReport> findDevices(const DiscoveryOptions& options) {
  return {findOpenHaptics(options), findForceDimension(options), findHaply(options), findEvdev()};
}

}  // namespace hapticd::device

#include "device/discovery/discovery.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <climits>
#include <exception>
#include <sstream>

#include "device/discovery/usb_devices.h"
#include "device/evdev/evdev_device.h"
#include "device/force_dimension/dhd_api.h"
#include "device/haply/haply_messages.h"
#include "device/haply/service_connection.h"
#include "device/openhaptics/openhaptics_device.h"

namespace hapticd::device {
namespace {

constexpr const char* kUdev =
    "the Debian package installs the udev rules; from the sources: sudo cp packaging/udev/70-hapticd.rules "
    "/etc/udev/rules.d/ && sudo udevadm control --reload && "
    "sudo udevadm trigger";

// The devices of one driver as the kernel lists them, without the driver's library.
struct Usb {
  std::vector<UsbDevice> devices;
  std::string
      words;  // devices that are plugged in and nodes that this user may not open, each followed by "; "
  bool refused = false;  // for lack of permission
};

Usb lookAtUsb(const DiscoveryOptions& options, const char* driver) {
  Usb usb;
  usb.devices = findUsbDevices(options.usbDevices, driver);
  for (const UsbDevice& device : usb.devices) {
    usb.words += device.text() + " is plugged in; ";
    for (const std::string& node : device.nodes) {
      const std::error_code error = options.mayUse(options.nodes / node);
      if (!error) continue;
      usb.words += (options.nodes / node).string() + ": " + error.message() + "; ";
      usb.refused = usb.refused || error == std::errc::permission_denied;
    }
  }
  return usb;
}

std::string withoutEnd(const std::string& words) {
  return words.substr(0, words.size() - std::min<std::size_t>(words.size(), 2));
}

DriverReport findOpenHaptics(const DiscoveryOptions& options) {
  DriverReport report{"openhaptics", {}, {}, {}};
  const Usb usb = lookAtUsb(options, "openhaptics");
  const std::string rights = usb.refused ? kUdev : "";
  try {
    hd::Scheduler::get();
  } catch (const LibraryError& error) {
    report.reason = usb.words + error.what();
    report.remedy =
        "install the Touch device driver and OpenHaptics of 3D Systems, and the library that the reason "
        "names" +
        (usb.refused ? "; then: " + rights : "");
    return report;
  }
  if (!options.openThem) {
    if (usb.refused) {
      report.reason = withoutEnd(usb.words);
      report.remedy = rights;
      return report;
    }
    for (const UsbDevice& device : usb.devices) report.devices.push_back(device.text());
    if (usb.devices.empty()) {
      report.reason = "no device on USB; for others only opening shows whether one is connected";
      report.remedy = "hapticd devices --open";
    }
    return report;
  }
  try {
    OpenHapticsDevice device;
    device.open();
    report.devices.push_back(device.description());
  } catch (const std::exception& error) {
    report.reason = usb.words + error.what();
    report.remedy = usb.refused
                        ? rights
                        : "run the vendor's setup tool once, as it names the device; for a USB device "
                          "also: " +
                              std::string(kUdev);
  }
  return report;
}

DriverReport findForceDimension(const DiscoveryOptions& options) {
  DriverReport report{"forcedimension", {}, {}, {}};
  const Usb usb = lookAtUsb(options, "forcedimension");
  const std::string rights = kUdev + std::string("; then plug it in again");
  try {
    const dhd::Api api{DynamicLibrary(dhd::libraryNames())};
    const int count = api.getDeviceCount();
    for (int i = 0; i < count; ++i) report.devices.push_back("device " + std::to_string(i));
    if (count > 0 && !usb.refused) return report;
    report.reason = count > 0 ? withoutEnd(usb.words) : usb.words + "the library finds no device";
    report.remedy = usb.refused           ? rights
                    : usb.devices.empty() ? "connect the device and switch it on"
                                          : "switch the device on, and end other programs that use it";
  } catch (const LibraryError& error) {
    report.reason = usb.words + error.what();
    report.remedy = "install the SDK of Force Dimension (libdrd.so.3), and libusb-1.0" +
                    (usb.refused ? "; then: " + rights : "");
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

// Whether an input device has a constant force. The kernel shows a bit set to every user: hexadecimal words,
// the highest first.
bool hasForce(const std::filesystem::path& inputDevice) {
  constexpr std::size_t kConstantForce = 0x52;
  constexpr std::size_t kWord = CHAR_BIT * sizeof(unsigned long);
  std::istringstream file(textOf(inputDevice / "device/capabilities/ff"));
  std::vector<unsigned long> words;
  for (unsigned long word = 0; file >> std::hex >> word;) words.push_back(word);
  const std::size_t index = kConstantForce / kWord;
  if (index >= words.size()) return false;
  return (words[words.size() - 1 - index] >> kConstantForce % kWord & 1U) != 0;
}

std::string nameOf(const std::filesystem::path& inputDevice) {
  const std::string name = firstLine(inputDevice / "device/name");
  return name.empty() ? "an input device" : name;
}

DriverReport findEvdev(const DiscoveryOptions& options) {
  DriverReport report{"evdev", {}, {}, {}};
  const std::vector<std::string> paths = eventDevicePaths(options.nodes / "input");
  const auto refuse = [&](const std::string& words) {
    report.reason += (report.reason.empty() ? "" : "; ") + words;
    report.remedy = kUdev;
  };
  for (const std::string& path : paths) {
    const auto inputDevice = options.inputDevices / std::filesystem::path(path).filename();
    if (const std::error_code error = options.mayUse(path)) {
      if (hasForce(inputDevice)) refuse(nameOf(inputDevice) + ", " + path + ": " + error.message());
      continue;
    }
    try {
      report.devices.push_back(path + ": " + EvdevDevice::probe(path));
    } catch (const NoForceFeedback&) {
      // A keyboard.
    } catch (const std::exception& error) {
      refuse(error.what());
    }
  }
  if (report.devices.empty() && report.reason.empty()) {
    report.reason = paths.empty() ? "there is no " + (options.nodes / "input/event*").string()
                                  : "no input device here has force feedback";
    report.remedy = "connect a joystick or wheel that Linux supports with force feedback";
  }
  return report;
}

}  // namespace

std::error_code mayReadAndWrite(const std::filesystem::path& node) {
  if (access(node.c_str(), R_OK | W_OK) == 0) return {};
  return {errno, std::generic_category()};
}

std::vector<DriverReport> findDevices(const DiscoveryOptions& options) {
  return {findOpenHaptics(options), findForceDimension(options), findHaply(options), findEvdev(options)};
}

}  // namespace hapticd::device

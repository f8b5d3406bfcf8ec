// USB devices that are plugged in, whether or not a driver can use them.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace hapticd::device {

/// The content of a small file of the kernel, such as those in /sys; empty when it cannot be read.
std::string textOf(const std::filesystem::path& file);
/// Its first line.
std::string firstLine(const std::filesystem::path& file);

/// USB identity by which a driver recognises its devices; packaging/udev has a rule for each.
struct UsbKind {
  std::string_view driver;
  std::string_view vendor;   ///< four hexadecimal digits
  std::string_view product;  ///< four hexadecimal digits; empty: any
};
inline constexpr UsbKind kUsbKinds[] = {
    {"openhaptics", "2988", ""}, {"openhaptics", "0301", "2988"}, {"forcedimension", "1451", ""}};

struct UsbDevice {
  std::string vendor;   ///< four hexadecimal digits
  std::string product;  ///< four hexadecimal digits
  std::string name;     ///< product string; may be empty
  /// Nodes below /dev that a library opens to reach it: a serial line or HID device, else the USB device
  /// itself.
  std::vector<std::string> nodes;

  std::string text() const {
    return (name.empty() ? "a device" : name) + " (USB " + vendor + ":" + product + ")";
  }
};

/// Devices of this driver below a folder that looks like /sys/bus/usb/devices, by vendor and product.
std::vector<UsbDevice> findUsbDevices(const std::filesystem::path& folder, std::string_view driver);

}  // namespace hapticd::device

// What is plugged in, whether or not a driver can use it.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace hapticd::device {

struct UsbDevice {
  std::string vendor;   ///< four hexadecimal digits
  std::string product;  ///< four hexadecimal digits
  std::string name;     ///< as it calls itself; may be empty

  std::string text() const {
    return (name.empty() ? "a device" : name) + " (USB " + vendor + ":" + product + ")";
  }
};

/// Devices of these vendors below a folder that looks like /sys/bus/usb/devices, by vendor and product.
std::vector<UsbDevice> findUsbDevices(const std::filesystem::path& folder,
                                      std::initializer_list<std::string_view> vendors);

}  // namespace hapticd::device

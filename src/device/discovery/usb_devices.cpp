#include "device/discovery/usb_devices.h"

#include <algorithm>
#include <fstream>
#include <system_error>
#include <tuple>

namespace hapticd::device {
namespace {

std::string firstLine(const std::filesystem::path& file) {
  std::string line;
  std::ifstream in(file);
  std::getline(in, line);
  return line;
}

}  // namespace

std::vector<UsbDevice> findUsbDevices(const std::filesystem::path& folder,
                                      std::initializer_list<std::string_view> vendors) {
  std::vector<UsbDevice> found;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    const UsbDevice device{firstLine(entry.path() / "idVendor"), firstLine(entry.path() / "idProduct"),
                           firstLine(entry.path() / "product")};
    if (std::find(vendors.begin(), vendors.end(), device.vendor) != vendors.end()) found.push_back(device);
  }
  std::sort(found.begin(), found.end(), [](const UsbDevice& a, const UsbDevice& b) {
    return std::tie(a.vendor, a.product) < std::tie(b.vendor, b.product);
  });
  return found;
}

}  // namespace hapticd::device

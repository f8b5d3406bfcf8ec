#include "device/discovery/usb_devices.h"

#include <algorithm>
#include <system_error>
#include <tuple>

#include "base/world.h"

namespace hapticd::device {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepest = 6;  // below a device: interface, HID device, kind, node

// The kernel lists the nodes of an interface in a folder of their kind.
std::vector<std::string> nodesOf(const fs::path& device) {
  std::vector<std::string> nodes;
  std::error_code ignored;
  // Through the link that the device is; the links below it lead elsewhere.
  for (fs::recursive_directory_iterator it(fs::canonical(device, ignored), ignored), end; it != end;
       it.increment(ignored)) {
    const std::string kind = it->path().parent_path().filename().string();
    if (kind == "tty" || kind == "hidraw") nodes.push_back(it->path().filename().string());
    if (it.depth() > kDeepest) it.disable_recursion_pending();
  }
  if (!nodes.empty()) {
    std::sort(nodes.begin(), nodes.end());
    return nodes;
  }
  const std::string bus = firstLine(device / "busnum");
  const std::string number = firstLine(device / "devnum");
  if (bus.empty() || number.empty()) return {};
  const auto digits = [](const std::string& n) {
    return std::string(n.size() < 3 ? 3 - n.size() : 0, '0') + n;
  };
  return {"bus/usb/" + digits(bus) + "/" + digits(number)};
}

bool belongsTo(const UsbDevice& device, std::string_view driver) {
  return std::any_of(std::begin(kUsbKinds), std::end(kUsbKinds), [&](const UsbKind& kind) {
    return kind.driver == driver && kind.vendor == device.vendor &&
           (kind.product.empty() || kind.product == device.product);
  });
}

}  // namespace

std::string textOf(const fs::path& file) {
  try {
    const std::vector<std::byte> bytes = base::world().files.read(file);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  } catch (const std::system_error&) {
    return {};
  }
}

std::string firstLine(const fs::path& file) {
  const std::string text = textOf(file);
  return text.substr(0, text.find('\n'));
}

std::vector<UsbDevice> findUsbDevices(const fs::path& folder, std::string_view driver) {
  std::vector<UsbDevice> found;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    UsbDevice device{firstLine(entry.path() / "idVendor"),
                     firstLine(entry.path() / "idProduct"),
                     firstLine(entry.path() / "product"),
                     {}};
    if (!belongsTo(device, driver)) continue;
    device.nodes = nodesOf(entry.path());
    found.push_back(std::move(device));
  }
  std::sort(found.begin(), found.end(), [](const UsbDevice& a, const UsbDevice& b) {
    return std::tie(a.vendor, a.product) < std::tie(b.vendor, b.product);
  });
  return found;
}

}  // namespace hapticd::device

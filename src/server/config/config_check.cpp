#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <map>
#include <sstream>

#include "device/drivers/drivers.h"
#include "net/endpoint.h"
#include "server/config/config.h"
#include "wire/text.h"

namespace hapticd::server {
namespace {

// Checks the values of one device, or of the server itself; each error names the device and the key.
class Checker {
 public:
  Checker() = default;
  Checker(std::size_t device, const std::string& name)
      : device_(device), prefix_("device '" + name + "': ") {}

  [[noreturn]] void fail(const std::string& key, const std::string& text) const {
    throw InvalidValue(device_, key, prefix_ + text);
  }

  void range(const std::string& key, double value, double low, double high) const {
    if (value >= low && value <= high) return;
    std::ostringstream text;
    text << key << " must be between " << low << " and " << high << ", got " << value;
    fail(key, text.str());
  }

  void address(const std::string& key, const std::string& value, const char* example) const {
    try {
      if (value.find(':') == std::string::npos) {
        net::Endpoint::parse(value, 1);
        return;
      }
    } catch (const net::Error&) {
    }
    fail(key, key + ": " + wire::inQuotes(value) + " is not an IPv4 address such as " + example);
  }

 private:
  std::optional<std::size_t> device_;
  std::string prefix_;
};

void checkName(std::size_t device, const std::string& name, std::map<std::string, int>& uses) {
  const auto fail = [&](const std::string& text) { throw InvalidValue(device, "names", text); };
  // VRPN's receivers refuse longer descriptions, and its clients split NAME@HOST at the '@'.
  const bool plain = std::none_of(name.begin(), name.end(), [](char c) {
    return c == '@' || c == 0x7f || static_cast<unsigned char>(c) < 0x20;
  });
  if (name.empty() || name.size() > 95 || !plain) {
    fail("device name " + wire::inQuotes(name) +
         " must have 1 to 95 characters, no '@' and no control characters");
  }
  if (name == "VRPN Control") fail("the name 'VRPN Control' is reserved by VRPN");
  if (++uses[name] > 1) fail("the name '" + name + "' is used twice; device names must be unique");
}

void checkDriver(const Checker& check, const DeviceConfig& device) {
  const device::Driver* const driver = device::findDriver(device.driver);
  if (driver == nullptr) {
    check.fail("driver", "unknown driver '" + device.driver + "'; available: " + device::driverNames());
  }
  if (device.isolate.value_or(false) && !driver->canBeIsolated) {
    check.fail("isolate", "the driver '" + device.driver +
                              "' loads no vendor library and cannot be isolated; remove isolate");
  }
  for (const auto& [key, value] : device.driverKeys) {
    if (std::find(driver->keys.begin(), driver->keys.end(), key) != driver->keys.end()) continue;
    check.fail(key, "the driver '" + device.driver + "' has no key " + key + "; remove it");
  }
}

void checkWorkspace(const Checker& check, const std::vector<double>& box) {
  if (!box.empty() && (box.size() != 6 || !(box[0] < box[3] && box[1] < box[4] && box[2] < box[5]))) {
    check.fail("workspace",
               "workspace needs six numbers in mm: min x y z, then max x y z, each min below its max");
  }
  for (const double bound : box) check.range("workspace", bound, -10000, 10000);
  constexpr double kSmallest_mm = 1;
  for (std::size_t i = 0; box.size() == 6 && i < 3; ++i) {
    if (box[i + 3] - box[i] >= kSmallest_mm) continue;
    std::ostringstream text;
    text << "workspace: an edge of " << box[i + 3] - box[i] << " mm is too short; use 1 mm or more";
    check.fail("workspace", text.str());
  }
}

void checkControl(const Checker& check, const DeviceConfig& device) {
  const bool listed = device.control == Control::list;
  if (listed && device.controlList.empty()) {
    check.fail("control",
               R"(control = "list" needs the addresses that may command, e.g. control_list = ["10.0.0.5"])");
  }
  if (!listed && !device.controlList.empty()) {
    check.fail("control_list", R"(control_list has no effect without control = "list")");
  }
  for (const std::string& address : device.controlList) check.address("control_list", address, "10.0.0.5");
}

// `http` must be ADDR:PORT; `http_allow` holds names that a browser can send as Host.
void checkHttp(const Checker& check, const ServerConfig& config) {
  if (config.http != kHttpAuto && config.http != kHttpOff) {
    const std::string kAny = "0.0.0.0";
    bool clash = false;
    try {
      std::string address = "127.0.0.1";
      std::uint16_t port = 8080;
      parseListen(config.http, address, port);
      net::Endpoint::parse(address, port);
      clash = port != 0 && port == config.port &&
              (address == config.listenAddress || address == kAny || config.listenAddress == kAny);
    } catch (const std::runtime_error&) {
      check.fail("http", "http: " + wire::inQuotes(config.http) +
                             " is not ADDR:PORT such as 127.0.0.1:8080, auto or off");
    }
    if (clash) {
      check.fail("http", "http: " + wire::inQuotes(config.http) + " is the port of listen; use another port");
    }
  }
  for (const std::string& name : config.httpAllow) {
    const std::size_t colon = name.find(':');
    const std::string port = colon == std::string::npos ? "1" : name.substr(colon + 1);
    const bool digits = !port.empty() && port.size() <= 5 &&
                        std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; });
    const std::string host = name.substr(0, colon);
    const bool plain = !host.empty() && std::all_of(host.begin(), host.end(), [](unsigned char c) {
      return std::isalnum(c) != 0 || c == '-' || c == '.' || c == '_';
    });
    if (!digits || !plain) {
      check.fail("http_allow",
                 "http_allow: " + wire::inQuotes(name) + " is not HOST or HOST:PORT such as haptics.local");
    }
  }
}

void checkDevice(const Checker& check, const DeviceConfig& device) {
  checkDriver(check, device);
  check.range("servo_rate_Hz", device.servoRate_Hz, 250, 4000);
  check.range("report_rate_Hz", device.reportRate_Hz, 0.1, device.servoRate_Hz);
  check.range("linear_tolerance_mm", device.linearTolerance_m * 1e3, 0, 1000);
  check.range("angular_tolerance_rad", device.angularTolerance_rad, 0, 3.2);
  check.range("tool_radius_mm", device.toolRadius_m * 1e3, 0, 50);
  check.range("stribeck_speed_mm_per_s", device.stribeckSpeed_m_per_s * 1e3, 0, 1000);
  check.range("black_box_keep", device.blackBoxKeep, 0, 1000);
  checkWorkspace(check, device.workspace_mm);
  checkControl(check, device);
}

void checkRecord(const Checker& check, const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension();
  for (const char* to : {"mcap", "csv", "vrpn"}) {
    if (extension != std::string(".") + to) continue;
    check.fail("record", "record: the server writes *.haptics recordings only, got '" + file +
                             "'; convert the recording afterwards with 'hapticd export FILE.haptics --to " +
                             to + "'");
  }
}

}  // namespace

void parseListen(const std::string& text, std::string& address, std::uint16_t& port) {
  const std::size_t colon = text.rfind(':');
  const std::string host = text.substr(0, colon);
  if (!host.empty()) address = host;
  if (colon == std::string::npos) return;
  const std::string digits = text.substr(colon + 1);
  unsigned value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc{} || end != digits.data() + digits.size() || value > 65535) {
    throw ConfigError("'" + text + "' is not ADDR:PORT with a port from 0 to 65535, e.g. 127.0.0.1:3883");
  }
  port = static_cast<std::uint16_t>(value);
}

std::filesystem::path defaultBlackBoxDir() {
  // The XDG specification says to ignore relative paths.
  const char* state = std::getenv("XDG_STATE_HOME");
  if (state != nullptr && std::filesystem::path(state).is_absolute()) {
    return std::filesystem::path(state) / "hapticd";
  }
  const char* home = std::getenv("HOME");
  if (home != nullptr && *home != '\0') return std::filesystem::path(home) / ".local/state/hapticd";
  std::error_code none;
  return std::filesystem::temp_directory_path(none) / "hapticd";
}

void validate(const ServerConfig& config) {
  const Checker server;
  server.address("listen", config.listenAddress, "127.0.0.1");
  checkRecord(server, config.record);
  server.range("seconds", config.seconds, 0, 1e9);
  checkHttp(server, config);
  server.range("connections", config.connections, 1, 100'000);
  server.range("connections_per_address", config.connectionsPerAddress, 1, 100'000);
  for (const std::string& host : config.callbackHosts) server.address("callback_hosts", host, "10.0.0.7");
  std::map<std::string, int> uses;
  std::map<std::string, const DeviceConfig*> scenes;
  for (std::size_t i = 0; i < config.devices.size(); ++i) {
    const DeviceConfig& device = config.devices[i];
    if (device.names.empty())
      throw InvalidValue(i, "names", "a device needs at least one name, e.g. name = \"Phantom\"");
    for (const std::string& name : device.names) checkName(i, name, uses);
    const Checker check(i, device.names.front());
    checkDevice(check, device);
    if (device.scene.empty()) continue;
    const DeviceConfig& first = *scenes.try_emplace(device.scene, &device).first->second;
    const auto same = [&](const char* key, bool is) {
      if (!is) check.fail(key, "all devices of the scene '" + device.scene + "' must have the same " + key);
    };
    same("scene_on_disconnect", device.sceneOnDisconnect == first.sceneOnDisconnect);
    // Commands to one device of a scene are felt on all.
    same("control", device.control == first.control);
    same("control_list", device.controlList == first.controlList);
  }
}

}  // namespace hapticd::server

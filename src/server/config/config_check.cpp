#include <fmt/format.h>
#include <pwd.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <map>
#include <sstream>

#include "base/printable.h"
#include "device/drivers/drivers.h"
#include "net/endpoint.h"
#include "net/local_socket.h"
#include "server/config/config.h"
#include "wire/names.h"
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
    // Enough digits to tell the value from the end of the range.
    fail(key, fmt::format("{} must be between {:.15g} and {:.15g}, got {:.15g}", key, low, high, value));
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
  // VRPN's receivers refuse longer descriptions, and its clients split NAME@HOST at the '@'. Names of VRPN
  // are bytes: they need not be UTF-8.
  const bool plain = name.find('@') == std::string::npos && base::printable(name) == base::utf8(name);
  if (name.empty() || name.size() > wire::kMaxNameBytes || !plain) {
    fail("device name " + wire::inQuotes(name) +
         " must have 1 to 95 bytes, no '@' and no control characters");
  }
  if (name == "VRPN Control") fail("the name 'VRPN Control' is reserved by VRPN");
  if (++uses[name] > 1) fail("the name '" + name + "' is used twice; device names must be unique");
  constexpr std::size_t kMost = wire::kMaxNames - 1;  // beside VRPN Control
  if (uses.size() > kMost)
    fail(fmt::format("the name '{}' is one too many: VRPN has numbers for {}, with mirrors", name, kMost));
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
  if (device.isolateWatch && !driver->canBeIsolated) {
    check.fail("isolate_watch",
               "the driver '" + device.driver +
                   "' cannot be isolated, so there is nothing to watch; remove isolate_watch");
  }
  if (device.isolateWatch && !device.isolate.value_or(true))
    check.fail("isolate_watch", "isolate is false, so there is nothing to watch; remove one of them");
  if (!driver->hasHardware && !device.hardware.empty()) {
    check.fail("hardware", "the driver '" + device.driver + "' has no hardware to choose from; remove " +
                               wire::inQuotes(device.hardware));
  }
  if (!driver->hasHand && device.hand != DeviceConfig().hand)
    check.fail("hand", "the driver '" + device.driver + "' is led by its own hand; remove " +
                           wire::inQuotes(device.hand));
  if (device.hand.empty()) check.fail("hand", R"(hand is empty; use "script", or the name of a file)");
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
  if (config.http.empty()) {
    check.fail("http", "http: " + wire::inQuotes(config.http) +
                           " is not ADDR:PORT such as 127.0.0.1:8080, auto or off");
  }
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
                        std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; }) &&
                        std::stoul(port) <= 65535;
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

void checkAccess(const Checker& check, const ServerConfig& config) {
  const auto checked = [&](const char* key, const auto& parse) {
    try {
      parse();
    } catch (const InvalidValue&) {
      throw;
    } catch (const ConfigError& error) {
      check.fail(key, error.what());
    }
  };
  checked("trusted_networks", [&] { parseSubnets(config.trustedNetworks); });
  checked("owner_users", [&] { usersNamed(config.ownerUsers, "owner_users"); });
  checked("operator_users", [&] { usersNamed(config.operatorUsers, "operator_users"); });
  const bool path = config.socket.starts_with('/') && !config.socket.ends_with('/');
  if (!path && config.socket != kSocketAuto && config.socket != kSocketOff) {
    check.fail("socket", "socket: " + wire::inQuotes(config.socket) +
                             " is not an absolute path such as /run/hapticd/lab.sock, auto or off");
  }
  if (config.socket.size() > net::kLongestSocketPath) {
    check.fail("socket", fmt::format("socket: the path has {} bytes, and that of a Unix socket at most {}",
                                     config.socket.size(), net::kLongestSocketPath));
  }
}

// Whether other machines can reach this address of ours.
bool reachesOut(const std::string& address) {
  return !net::isLoopback(net::Endpoint::parse(address, 1).address);
}

void checkTransport(const Checker& check, const ServerConfig& config) {
  const bool file = config.tls != kTlsOff && config.tls != kTlsGenerated;
  if (file && !config.tls.starts_with('/')) {
    check.fail("tls", "tls: " + wire::inQuotes(config.tls) +
                          " is not off, generated, or the absolute path of a certificate (PEM)");
  }
  if (file != !config.tlsKey.empty()) {
    check.fail("tls_key", file ? "tls: the certificate '" + config.tls + "' needs its key: set tls_key"
                               : "tls_key has no effect without a certificate: set tls to its file");
  }
  if (config.tls == kTlsOff && config.tlsLoopback)
    check.fail("tls_loopback", R"(tls_loopback needs a certificate: set tls to "generated" or to its file)");
  if (config.insecure || config.tls != kTlsOff || !config.trustedNetworks.empty()) return;
  std::string http = "127.0.0.1";
  std::uint16_t port = 0;
  if (config.http != kHttpAuto && config.http != kHttpOff) parseListen(config.http, http, port);
  for (const auto& [key, address] : {std::pair{"listen", config.listenAddress}, std::pair{"http", http}}) {
    if (!reachesOut(address)) continue;
    check.fail(key,
               std::string(key) + ": " + wire::inQuotes(address) +
                   " lets other machines in, without encryption and without knowing who they are: "
                   "everybody on these networks could move the arm. Set tls, or trusted_networks for the "
                   "networks where you trust everybody, or accept it by insecure = true (--insecure)");
  }
}

// HOST:PORT with a numeric host; every name of this machine is 127.0.0.1, and 0.0.0.0 is any address of it.
bool sameService(const std::string& a, const std::string& b) {
  const auto hostOf = [](const std::string& text) {
    const std::string host = text.substr(0, text.rfind(':'));
    return host == "localhost" || host == "0.0.0.0" || host.starts_with("127.") || host.empty()
               ? std::string("127.0.0.1")
               : host;
  };
  return hostOf(a) == hostOf(b) && a.substr(a.rfind(':') + 1) == b.substr(b.rfind(':') + 1);
}

void checkHaply(const Checker& check, const ServerConfig& config) {
  const CompatConfig& compat = config.compat;
  check.range("haply_hold_ms", compat.haplyHold_s * 1e3, 10, 100);
  for (const std::string& origin : compat.haplyOrigins) {
    const std::size_t host = origin.find("://");
    const bool web = origin.starts_with("http://") || origin.starts_with("https://");
    if (web && host + 3 < origin.size() && origin.find_first_of("/* ", host + 3) == std::string::npos)
      continue;
    check.fail("haply_origins", "haply_origins: " + wire::inQuotes(origin) +
                                    " is not an origin such as http://localhost:5173");
  }
  if (compat.haply.empty()) return;
  std::string address = "127.0.0.1";
  std::uint16_t port = kHaplyPort;
  try {
    parseListen(compat.haply, address, port);
    net::Endpoint::parse(address, port);
  } catch (const std::runtime_error&) {
    check.fail("haply",
               "haply: " + wire::inQuotes(compat.haply) + " is not ADDR:PORT such as 127.0.0.1:10001");
  }
  if (reachesOut(address) && !config.insecure && config.trustedNetworks.empty()) {
    check.fail("haply",
               "haply: " + wire::inQuotes(compat.haply) +
                   " lets other machines in, and this port is not encrypted: set trusted_networks for "
                   "the networks where you trust everybody, or accept it by insecure = true");
  }
  if (port == 0) return;
  const std::string place = address + ":" + std::to_string(port);
  const auto refuse = [&](const std::string& other) {
    check.fail("haply",
               "haply: " + wire::inQuotes(compat.haply) + " is the port of " + other + "; use another port");
  };
  if (sameService(place, config.listenAddress + ":" + std::to_string(config.port))) refuse("listen");
  if (config.http != kHttpOff) {
    std::string webAddress = "127.0.0.1";
    std::uint16_t webPort = 8080;
    if (config.http != kHttpAuto) parseListen(config.http, webAddress, webPort);
    if (sameService(place, webAddress + ":" + std::to_string(webPort))) refuse("http");
  }
  // The driver would be served by its own server.
  for (const DeviceConfig& device : config.devices) {
    const device::Driver* const driver = device::findDriver(device.driver);
    if (driver == nullptr || driver->service == nullptr) continue;
    if (sameService(place, driver->service(device.hardware)))
      refuse("the service that the device '" + device.names.front() + "' is reached through");
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
  check.range("held_force_power_mW", device.heldForcePower_W * 1e3, 0, 10'000);
  check.range("black_box_keep", device.blackBoxKeep, 0, 1000);
  checkWorkspace(check, device.workspace_mm);
  checkControl(check, device);
}

void checkLimits(const Checker& check, const LimitsConfig& limits) {
  constexpr int kMostTriangles = 32'000'000;
  check.range("connections", limits.connections, 1, 100'000);
  check.range("connections_per_address", limits.connectionsPerAddress, 1, 100'000);
  check.range("connections_unfinished", limits.unfinishedConnections, 16, 100'000);
  check.range("memory_MB", limits.memory_MB, 64, 1'000'000);
  check.range("client_memory_MB", limits.clientMemory_MB, 32, limits.memory_MB);
  check.range("send_queue_MB", limits.sendQueue_MB, 1, 1000);
  check.range("batches_MB", limits.batches_MB, 1, 100'000);
  check.range("objects", limits.objects, 1, 10'000);
  check.range("vertices", limits.vertices, 3, kMostTriangles);
  check.range("triangles", limits.triangles, 1, kMostTriangles);
  check.range("effects", limits.effects, 1, 64);
  check.range("commands_per_second", limits.commandsPerSecond, 1000, 1e9);
  check.range("recording_MB", limits.recording_MB, 1, 1e9);
  check.range("black_boxes_MB", limits.blackBoxes_MB, 1, 1'000'000);
  check.range("log_kB_per_second", limits.log_kB_per_s, 1, 1'000'000);
}

void checkRecord(const Checker& check, const std::string& file) {
  if (file == "-")
    check.fail("record",
               "record: '-' would be a file of that name; the log is on standard output: name a file");
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
  if (text.starts_with('[') || std::count(text.begin(), text.end(), ':') > 1) {
    throw ConfigError("'" + text +
                      "' is an IPv6 address, which this server does not support; use an IPv4 address, e.g. "
                      "127.0.0.1:3883");
  }
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

std::vector<Subnet> parseSubnets(const std::vector<std::string>& texts) {
  std::vector<Subnet> subnets;
  for (const std::string& text : texts) {
    const std::size_t slash = text.find('/');
    unsigned bits = 32;
    bool good = text.find(':') == std::string::npos;
    if (slash != std::string::npos) {
      const char* const last = text.data() + text.size();
      const auto [end, error] = std::from_chars(text.data() + slash + 1, last, bits);
      good = good && error == std::errc{} && end == last && bits <= 32;
    }
    Subnet subnet;
    try {
      subnet.network = net::Endpoint::parse(text.substr(0, slash), 1).address;
    } catch (const net::Error&) {
      good = false;
    }
    subnet.mask = bits == 0 || bits > 32 ? 0 : ~std::uint32_t{0} << (32 - bits);
    if (!good) {
      throw ConfigError("trusted_networks: " + wire::inQuotes(text) +
                        " is not a network such as 10.0.0.0/24, or an address");
    }
    if ((subnet.network & ~subnet.mask) != 0) {
      const net::Endpoint network{subnet.network & subnet.mask, 0};
      throw ConfigError(
          fmt::format("trusted_networks: the bits of {} after the first {} must be 0: use {}/{}",
                      wire::inQuotes(text), bits, network.addressText(), bits));
    }
    subnets.push_back(subnet);
  }
  return subnets;
}

std::vector<std::uint32_t> usersNamed(const std::vector<std::string>& names, const std::string& key) {
  std::vector<std::uint32_t> users;
  for (const std::string& name : names) {
    std::uint32_t number = 0;
    const char* const last = name.data() + name.size();
    const auto [end, error] = std::from_chars(name.data(), last, number);
    if (error == std::errc{} && end == last) {
      users.push_back(number);
    } else if (const passwd* const user = getpwnam(name.c_str())) {
      users.push_back(user->pw_uid);
    } else {
      throw ConfigError(key + ": there is no user " + wire::inQuotes(name) + " on this machine");
    }
  }
  return users;
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
  checkLimits(server, config.limits);
  checkAccess(server, config);
  checkTransport(server, config);
  for (const std::string& host : config.callbackHosts) server.address("callback_hosts", host, "10.0.0.7");
  std::map<std::string, int> uses;
  std::map<std::string, const DeviceConfig*> scenes;
  for (std::size_t i = 0; i < config.devices.size(); ++i) {
    const DeviceConfig& device = config.devices[i];
    if (device.names.empty())
      throw InvalidValue(i, "names", "a device needs at least one name, e.g. name = \"Phantom\"");
    for (const std::string& name : device.names) {
      checkName(i, name, uses);
      if (!device.mirrors) continue;
      for (const auto& mirror : kMirrors) checkName(i, name + mirror.second, uses);
    }
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
  checkHaply(server, config);
}

}  // namespace hapticd::server

#include "server/config.h"

#include <toml++/toml.h>
#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "net/endpoint.h"
#include "wire/text.h"

namespace hapticd::server {
namespace {

// Where a key stands in its file, for the error's first words.
std::string where(const std::string& source, const toml::node& node) {
  std::ostringstream text;
  text << source << ":" << node.source().begin.line << ": ";
  return text.str();
}

std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t cost = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, cost});
    }
  }
  return row[b.size()];
}

// One table of the file; take() reads a key once, finish() rejects what nobody took.
class Reader {
 public:
  Reader(const toml::table& table, std::string source) : table_(table), source_(std::move(source)) {}

  void take(const std::string& key, double& out) {
    if (const toml::node* node = find(key)) {
      const auto value = node->value<double>();
      if (!value) fail(*node, key, "a number");
      out = *value;
    }
  }
  void take(const std::string& key, bool& out) {
    if (const toml::node* node = find(key)) {
      const auto value = node->value_exact<bool>();
      if (!value) fail(*node, key, "true or false");
      out = *value;
    }
  }
  void take(const std::string& key, std::string& out) {
    if (const toml::node* node = find(key)) {
      const auto value = node->value_exact<std::string>();
      if (!value) fail(*node, key, "a text in quotes");
      out = *value;
    }
  }
  void take(const std::string& key, std::vector<std::string>& out) { takeList(key, out, "a list of texts"); }
  void take(const std::string& key, std::vector<double>& out) { takeList(key, out, "a list of numbers"); }

  template <class Enum, std::size_t N>
  void take(const std::string& key, Enum& out, const std::array<std::pair<const char*, Enum>, N>& choices) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::string>();
    std::string expected;
    for (const auto& [name, choice] : choices) {
      if (value && *value == name) {
        out = choice;
        return;
      }
      expected += (expected.empty() ? "\"" : " or \"") + std::string(name) + "\"";
    }
    fail(*node, key, expected);
  }

  const toml::node* find(const std::string& key) {
    known_.insert(key);
    return table_.get(key);
  }

  void finish() const {
    for (const auto& [key, node] : table_) {
      const std::string name(key.str());
      if (known_.count(name) != 0) continue;
      const auto nearest = std::min_element(known_.begin(), known_.end(), [&](const auto& a, const auto& b) {
        return editDistance(name, a) < editDistance(name, b);
      });
      throw ConfigError(where(source_, node) + "unknown key '" + name + "'; did you mean '" + *nearest +
                        "'?");
    }
  }

  [[noreturn]] void fail(const toml::node& node, const std::string& key, const std::string& expected) const {
    std::ostringstream value;
    node.visit([&](const auto& n) { value << n; });
    throw ConfigError(where(source_, node) + "'" + key + "' is " + value.str() + ", expected " + expected);
  }

 private:
  template <class T>
  void takeList(const std::string& key, std::vector<T>& out, const char* expected) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const toml::array* list = node->as_array();
    if (list == nullptr) fail(*node, key, expected);
    out.clear();
    for (const toml::node& item : *list) {
      const auto value = item.value<T>();
      if (!value) fail(*node, key, expected);
      out.push_back(*value);
    }
  }

  const toml::table& table_;
  std::string source_;
  std::set<std::string> known_;
};

DeviceConfig readDevice(const toml::table& table, const std::string& source) {
  DeviceConfig device;
  Reader reader(table, source);
  if (std::string name; table.contains("name")) {
    reader.take("name", name);
    device.names = {name};
  }
  reader.take("names", device.names);
  reader.find("name");
  reader.take("driver", device.driver);
  reader.take("hardware", device.hardware);
  reader.take("wheel_profile", device.wheelProfile);
  reader.take("calibrate", device.calibrate);
  reader.take("enable_forces", device.enableForces);
  reader.take("hand", device.hand);
  reader.take("servo_rate_Hz", device.servoRate_Hz);
  reader.take("report_rate_Hz", device.reportRate_Hz);
  double linear_mm = device.linearTolerance_m * 1e3;
  reader.take("linear_tolerance_mm", linear_mm);
  device.linearTolerance_m = linear_mm * 1e-3;
  reader.take("angular_tolerance_rad", device.angularTolerance_rad);
  double radius_mm = device.toolRadius_m * 1e3;
  reader.take("tool_radius_mm", radius_mm);
  device.toolRadius_m = radius_mm * 1e-3;
  const toml::node* workspace = reader.find("workspace");
  if (workspace != nullptr && workspace->is_string()) {
    const std::string choice = *workspace->value<std::string>();
    if (choice == "paper") {
      device.workspace_mm = {-80, -80, -70, 80, 80, 20};
    } else if (choice != "device") {
      reader.fail(*workspace, "workspace", "\"device\", \"paper\" or six numbers");
    }
  } else {
    reader.take("workspace", device.workspace_mm);
  }
  reader.take("material_scale", device.materialScale,
              std::array{std::pair{"reference", MaterialScale::reference},
                         std::pair{"device", MaterialScale::device}});
  reader.take("quaternion_order", device.quaternionOrder,
              std::array{std::pair{"xyzw", QuaternionOrder::xyzw}, std::pair{"wxyz", QuaternionOrder::wxyz}});
  reader.take("force_report", device.forceReport,
              std::array{std::pair{"total", ForceReport::total}, std::pair{"normal", ForceReport::normal}});
  reader.take("workspace_fit", device.workspaceFit,
              std::array{std::pair{"published", WorkspaceFit::published},
                         std::pair{"enclose", WorkspaceFit::enclose}});
  reader.take(
      "vibration_contact_unit", device.vibrationContactUnit,
      std::array{std::pair{"rad/s", VibrationUnit::radPerSecond}, std::pair{"Hz", VibrationUnit::hertz}});
  reader.take(
      "vibration_motor_frame", device.vibrationMotorFrame,
      std::array{std::pair{"stylus", VibrationFrame::stylus}, std::pair{"device", VibrationFrame::device}});
  reader.take(
      "scene_on_disconnect", device.sceneOnDisconnect,
      std::array{std::pair{"keep", SceneOnDisconnect::keep}, std::pair{"clear", SceneOnDisconnect::clear}});
  reader.finish();
  return device;
}

void requireRange(double value, double low, double high, const std::string& what) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << what << " is " << value << "; it must lie between " << low << " and " << high;
  throw ConfigError(text.str());
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

ServerConfig loadConfig(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw ConfigError("cannot read the configuration file '" + file.string() + "'");
  std::ostringstream text;
  text << in.rdbuf();
  return parseConfig(text.str(), file.string());
}

ServerConfig parseConfig(const std::string& text, const std::string& source) {
  toml::table root;
  try {
    root = toml::parse(text, source);
  } catch (const toml::parse_error& error) {
    std::ostringstream message;
    message << source << ":" << error.source().begin.line << ": " << error.description();
    throw ConfigError(message.str());
  }
  ServerConfig config;
  Reader reader(root, source);
  std::string listen;
  reader.take("listen", listen);
  if (!listen.empty()) parseListen(listen, config.listenAddress, config.port);
  reader.take("allow_no_rt", config.allowNoRealtime);
  reader.take("seconds", config.seconds);
  reader.take("callback_hosts", config.callbackHosts);
  if (const toml::node* node = reader.find("device")) {
    const toml::array* list = node->as_array();
    if (list == nullptr || list->empty() || !list->is_array_of_tables()) {
      throw ConfigError(where(source, *node) +
                        "'device' must be written as [[device]], once for each device");
    }
    config.devices.clear();
    for (const toml::node& item : *list) config.devices.push_back(readDevice(*item.as_table(), source));
  }
  reader.finish();
  validate(config);
  return config;
}

void validate(const ServerConfig& config) {
  requireRange(config.seconds, 0, 1e9, "seconds");
  for (const std::string& host : config.callbackHosts) {
    try {
      net::Endpoint::parse(host, 1);
    } catch (const net::Error&) {
      throw ConfigError("callback_hosts: " + wire::inQuotes(host) +
                        " is not an IPv4 address such as 10.0.0.7");
    }
  }
  std::map<std::string, int> uses;
  for (const DeviceConfig& device : config.devices) {
    if (device.names.empty()) throw ConfigError("a device needs a name, e.g. name = \"Phantom\"");
    for (const std::string& name : device.names) {
      // VRPN's receivers refuse longer descriptions, and its clients split NAME@HOST at the '@'.
      const bool plain = std::none_of(name.begin(), name.end(), [](char c) {
        return c == '@' || c == 0x7f || static_cast<unsigned char>(c) < 0x20;
      });
      if (name.empty() || name.size() > 95 || !plain) {
        throw ConfigError("device name " + wire::inQuotes(name) +
                          " must have 1 to 95 characters, no '@' and no control characters");
      }
      if (name == "VRPN Control") throw ConfigError("VRPN keeps the name 'VRPN Control' for itself");
      if (++uses[name] > 1) throw ConfigError("the name '" + name + "' is given twice");
    }
    const std::string who = "device '" + device.names.front() + "': ";
    requireRange(device.servoRate_Hz, 250, 4000, who + "servo_rate_Hz");
    requireRange(device.reportRate_Hz, 0.1, device.servoRate_Hz, who + "report_rate_Hz");
    requireRange(device.linearTolerance_m, 0, 1, who + "linear_tolerance_mm / 1000");
    requireRange(device.angularTolerance_rad, 0, 3.2, who + "angular_tolerance_rad");
    requireRange(device.toolRadius_m, 0, 0.05, who + "tool_radius_mm / 1000");
    const auto& box = device.workspace_mm;
    if (!box.empty() && (box.size() != 6 || !(box[0] < box[3] && box[1] < box[4] && box[2] < box[5]))) {
      throw ConfigError(who + "workspace needs six numbers, min x y z then max x y z, in mm");
    }
    for (const double bound : box) requireRange(bound, -10000, 10000, who + "workspace");
  }
}

}  // namespace hapticd::server

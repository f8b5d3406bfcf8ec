#include "server/config/config.h"

#include <toml++/toml.h>
#include <algorithm>
#include <cctype>
#include <limits>
#include <optional>
#include <set>
#include <sstream>

#include "base/nearest_name.h"
#include "base/world.h"
#include "server/config/config_fields.h"
#include "server/config/vrpn_cfg.h"

namespace hapticd::server {
namespace {

// "FILE:LINE: ", the start of an error text.
std::string location(const std::string& source, const toml::node& node) {
  std::ostringstream text;
  text << source << ":" << node.source().begin.line << ": ";
  return text.str();
}

// Reads one table of the file, each key once; finish() rejects unknown keys.
class Reader {
 public:
  Reader(const toml::table& table, std::string source) : table_(table), source_(std::move(source)) {}

  void field(const std::string& key, double& out) { take<double>(key, out, "a number"); }
  void field(const std::string& key, bool& out) { takeExact<bool>(key, out, "true or false"); }
  void field(const std::string& key, std::optional<bool>& out) {
    bool value = false;
    if (find(key) == nullptr) return;
    field(key, value);
    out = value;
  }
  void field(const std::string& key, std::string& out) {
    takeExact<std::string>(key, out, "a quoted string");
    if (out.find('\0') != std::string::npos) {
      fail(*find(key), key, "a quoted string without NUL characters");
    }
  }
  void field(const std::string& key, std::vector<std::string>& out) {
    takeList(key, out, "a list of quoted strings");
  }
  void field(const std::string& key, int& out) {
    std::int64_t value = out;
    takeExact<std::int64_t>(key, value, "a whole number");
    if (value < std::numeric_limits<int>::min() || value > std::numeric_limits<int>::max()) {
      fail(*find(key), key, "a whole number from -2147483648 to 2147483647");
    }
    out = static_cast<int>(value);
  }
  void driverKey(const std::string& key, std::map<std::string, std::string>& out) {
    std::string value;
    field(key, value);
    if (!value.empty()) out[key] = value;
  }
  void milli(const std::string& key, double& out) {
    if (find(key) == nullptr) return;
    field(key, out);
    out *= 1e-3;
  }
  void names(const std::string& key, std::vector<std::string>& out) {
    const toml::node* single = find("name");
    if (single != nullptr && find(key) != nullptr)
      fail(*single, "name", "either 'name' or 'names', not both");
    if (single != nullptr) {
      out.resize(1);
      field("name", out.front());
    }
    field(key, out);
  }
  void listen(const std::string& key, std::string& address, std::uint16_t& port) {
    if (find(key) == nullptr) return;
    std::string text;
    field(key, text);
    try {
      if (text.empty()) throw ConfigError("is empty; it is ADDR:PORT, e.g. 127.0.0.1:3883");
      parseListen(text, address, port);
    } catch (const ConfigError& error) {
      throw ConfigError(location(source_, *find(key)) + "listen: " + error.what());
    }
  }
  void workspace(const std::string& key, std::vector<double>& out) {
    const toml::node* node = find(key);
    const char* expected = "\"device\", \"paper\" or six numbers";
    if (node == nullptr || !node->is_string()) {
      takeList(key, out, expected);
      if (node != nullptr && out.empty()) fail(*node, key, expected);
      return;
    }
    const std::string choice = *node->value<std::string>();
    if (choice != "paper" && choice != "device") fail(*node, key, expected);
    out.clear();
    if (choice == "paper") out.assign(kPaperWorkspace_mm.begin(), kPaperWorkspace_mm.end());
  }

  template <class Enum, std::size_t N>
  void choice(const std::string& key, Enum& out, const Choices<Enum, N>& choices) {
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

  const std::set<std::string>& known() const { return known_; }

  /// `elsewhere`: keys of the other kinds of tables, and where they belong.
  void finish(const std::vector<std::pair<std::set<std::string>, std::string>>& elsewhere) const {
    for (const auto& [key, node] : table_) {
      const std::string name(key.str());
      if (known_.count(name) != 0) continue;
      for (const auto& [keys, place] : elsewhere) {
        if (keys.count(name) != 0)
          throw ConfigError(location(source_, node) + "'" + name + "' belongs " + place);
      }
      const std::vector<std::string> keys(known_.begin(), known_.end());
      const std::optional<std::string> nearest = base::nearestName(name, keys);
      throw ConfigError(
          location(source_, node) + "unknown key '" + name + "'; " +
          (nearest ? "did you mean '" + *nearest + "'?" : "docs/configuration.md lists the keys"));
    }
  }

 private:
  [[noreturn]] void fail(const toml::node& node, const std::string& key, const std::string& expected) const {
    std::ostringstream value;
    node.visit([&](const auto& n) { value << n; });
    throw ConfigError(location(source_, node) + "'" + key + "' is " + value.str() + ", expected " + expected);
  }

  template <class T>
  void take(const std::string& key, T& out, const char* expected) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto value = node->value<T>();
    if (!value) fail(*node, key, expected);
    out = *value;
  }

  template <class T>
  void takeExact(const std::string& key, T& out, const char* expected) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<T>();
    if (!value) fail(*node, key, expected);
    out = *value;
  }

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

// The keys of a kind of table, asked from an empty one.
template <class Config>
std::set<std::string> keysOf() {
  const toml::table none;
  Reader reader(none, "");
  Config config;
  visitFields(reader, config);
  return reader.known();
}

DeviceConfig readDevice(const toml::table& table, const std::string& source) {
  DeviceConfig device;
  Reader reader(table, source);
  visitFields(reader, device);
  if (table.get("report_rate_Hz") == nullptr)
    device.reportRate_Hz = std::min(device.reportRate_Hz, device.servoRate_Hz);
  reader.finish({{keysOf<ServerConfig>(), "above the first [[device]]"},
                 {keysOf<LimitsConfig>(), "in [limits], which belongs above the first [[device]]"},
                 {keysOf<CompatConfig>(), "in [compat], which belongs above the first [[device]]"}});
  return device;
}

std::vector<DeviceConfig> readDevices(const toml::node& node, const std::string& source) {
  const toml::array* list = node.as_array();
  if (list == nullptr || list->empty() || !list->is_array_of_tables()) {
    throw ConfigError(location(source, node) +
                      "'device' must be an array of tables: one [[device]] for each device");
  }
  std::vector<DeviceConfig> devices;
  for (const toml::node& item : *list) devices.push_back(readDevice(*item.as_table(), source));
  return devices;
}

// A table that the file has once: [compat], [limits].
template <class Config>
Config readTable(const toml::node& node, const std::string& name, const std::string& source) {
  const toml::table* table = node.as_table();
  if (table == nullptr)
    throw ConfigError(location(source, node) + "'" + name + "' must be a table: [" + name + "]");
  Config config;
  Reader reader(*table, source);
  visitFields(reader, config);
  const std::string place = "outside [" + name + "]";
  reader.finish({{keysOf<ServerConfig>(), place},
                 {keysOf<DeviceConfig>(), place},
                 {keysOf<LimitsConfig>(), "in [limits]"},
                 {keysOf<CompatConfig>(), "in [compat]"}});
  return config;
}

// The node that sets the value; for a default the table that it belongs to.
const toml::node& nodeOf(const InvalidValue& error, const toml::table& root) {
  const toml::table* table = &root;
  const toml::array* devices = root.get_as<toml::array>("device");
  if (error.device() && devices != nullptr) table = devices->get_as<toml::table>(*error.device());
  const toml::node* node = table->get(error.key());
  for (const char* name : {"compat", "limits"}) {
    const toml::table* const named = root.get_as<toml::table>(name);
    if (node == nullptr && !error.device() && named != nullptr) node = named->get(error.key());
  }
  if (node == nullptr && error.key() == "names") node = table->get("name");
  return node == nullptr ? *table : *node;
}

toml::table tableOf(const std::string& text, const std::string& source) {
  try {
    return toml::parse(text, source);
  } catch (const toml::parse_error& error) {
    std::ostringstream message;
    message << source << ":" << error.source().begin.line << ": " << error.description();
    if (text.starts_with("vrpn_") || text.find("\nvrpn_") != std::string::npos)
      message << "; a vrpn.cfg needs a name that ends with .cfg";
    throw ConfigError(message.str());
  }
}

ServerConfig read(const toml::table& root, const std::string& source) {
  ServerConfig config;
  Reader reader(root, source);
  visitFields(reader, config);
  if (const toml::node* node = reader.find("device")) config.devices = readDevices(*node, source);
  if (const toml::node* node = reader.find("compat"))
    config.compat = readTable<CompatConfig>(*node, "compat", source);
  if (const toml::node* node = reader.find("limits"))
    config.limits = readTable<LimitsConfig>(*node, "limits", source);
  reader.finish({{keysOf<DeviceConfig>(), "in a [[device]]"},
                 {keysOf<LimitsConfig>(), "in [limits]"},
                 {keysOf<CompatConfig>(), "in [compat]"}});
  return config;
}

std::string textOf(const std::filesystem::path& file) {
  try {
    const std::vector<std::byte> bytes = base::world().files.read(file);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  } catch (const std::system_error& error) {
    throw ConfigError("cannot read the configuration file '" + file.string() +
                      "': " + error.code().message());
  }
}

void check(const ServerConfig& config, const toml::table& root, const std::string& source) {
  try {
    validate(config);
  } catch (const InvalidValue& error) {
    throw ConfigError(location(source, nodeOf(error, root)) + error.what());
  }
}

}  // namespace

bool isVrpnCfg(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  return extension == ".cfg";
}

ServerConfig loadConfig(const std::filesystem::path& file, std::vector<std::string>& warnings) {
  const std::string text = textOf(file);
  if (isVrpnCfg(file)) return parseVrpnCfg(text, file.string(), warnings);
  return parseConfig(text, file.string());
}

std::string placeOf(const InvalidValue& error, const std::filesystem::path& file) {
  if (file.empty() || isVrpnCfg(file)) return "";
  const toml::table root = tableOf(textOf(file), file.string());
  return location(file.string(), nodeOf(error, root));
}

ServerConfig parseConfig(const std::string& text, const std::string& source) {
  const toml::table root = tableOf(text, source);
  ServerConfig config = read(root, source);
  check(config, root, source);
  return config;
}

ServerConfig parseRecordedConfig(const std::string& text, const std::string& source) {
  try {
    const toml::table root = tableOf(text, source);
    const ServerConfig recorded = read(root, source);
    ServerConfig config;
    config.announce = recorded.announce;
    config.limits = recorded.limits;
    config.devices = recorded.devices;
    for (DeviceConfig& device : config.devices) {
      device.hand = DeviceConfig().hand;
      device.hardware = DeviceConfig().hardware;
      device.blackBoxDir = DeviceConfig().blackBoxDir;
      device.isolateWatch = DeviceConfig().isolateWatch;
    }
    check(config, root, source);
    return config;
  } catch (const ConfigError& error) {
    throw std::runtime_error(std::string(error.what()) + "; the recording is damaged, or of a newer version");
  }
}

}  // namespace hapticd::server

#include "server/config/vrpn_cfg.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <sstream>
#include <string_view>

#include "wire/text.h"

namespace hapticd::server {
namespace {

constexpr std::string_view kBlank = " \t\r\f\v";
constexpr const char* kOpenHaptics =
    "vrpn_OpenHaptics NAME reset_position(0|1) report_rate_Hz linear_tolerance_mm angular_tolerance_rad "
    "DEVICE";
constexpr const char* kPhantom = "vrpn_Phantom NAME calibrate(0|1) report_rate_Hz DEVICE";

// One line, taken word by word.
class Line {
 public:
  Line(std::string_view text, std::string where) : rest_(text), where_(std::move(where)) { trim(); }

  bool atEnd() const { return rest_.empty() || rest_.front() == '#'; }
  std::string_view word() {
    const std::string_view word = atEnd() ? std::string_view() : rest_.substr(0, rest_.find_first_of(kBlank));
    rest_.remove_prefix(word.size());
    trim();
    return word;
  }
  /// What is left, spaces and all.
  std::string rest() const { return atEnd() ? std::string() : std::string(rest_); }

  double number(const char* what, double otherwise) {
    if (atEnd()) return otherwise;
    const std::string_view text = word();
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) fail(what, text, "a number");
    return value;
  }
  bool flag(const char* what) {
    const std::string_view text = word();
    if (text.empty() || text == "0") return false;
    if (text != "1") fail(what, text, "0 or 1");
    return true;
  }

  const std::string& where() const { return where_; }
  void form(const char* form) { form_ = form; }
  [[noreturn]] void fail(const std::string& text) const {
    throw ConfigError(where_ + text + "; the line reads " + form_);
  }

 private:
  [[noreturn]] void fail(const char* what, std::string_view value, const char* expected) const {
    fail(std::string(what) + " is " + wire::inQuotes(value) + ", expected " + expected);
  }
  void trim() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlank), rest_.size()));
    rest_.remove_suffix(rest_.size() - (rest_.find_last_not_of(kBlank) + 1));
  }

  std::string_view rest_;
  std::string where_;
  const char* form_ = "";
};

DeviceConfig readDevice(Line& line, bool openHaptics, std::vector<std::string>& remarks) {
  DeviceConfig device;
  device.driver = "openhaptics";
  if (line.atEnd()) line.fail("the name is missing");
  device.names = {std::string(line.word())};
  device.calibrate = line.flag(openHaptics ? "reset_position" : "calibrate");
  device.reportRate_Hz = line.number("report_rate_Hz", device.reportRate_Hz);
  if (device.reportRate_Hz > device.servoRate_Hz) {
    std::ostringstream text;
    text << line.where() << "report_rate_Hz is " << device.reportRate_Hz << ": reports come with each of the "
         << device.servoRate_Hz << " servo ticks a second";
    remarks.push_back(text.str());
    device.reportRate_Hz = device.servoRate_Hz;
  }
  if (openHaptics) {
    device.linearTolerance_m = line.number("linear_tolerance_mm", device.linearTolerance_m * 1e3) * 1e-3;
    device.angularTolerance_rad = line.number("angular_tolerance_rad", device.angularTolerance_rad);
    device.workspace_mm.assign(kPaperWorkspace_mm.begin(), kPaperWorkspace_mm.end());
  }
  device.hardware = line.rest();
  return device;
}

// A device of ours; nothing for other lines, which are remarked unless they say nothing.
std::optional<DeviceConfig> readLine(Line& line, std::vector<std::string>& remarks) {
  if (line.atEnd()) return std::nullopt;
  const std::string_view kind = line.word();
  const bool openHaptics = kind == "vrpn_OpenHaptics";
  if (!openHaptics && kind != "vrpn_Phantom") {
    remarks.push_back(line.where() + wire::inQuotes(kind) +
                      " is no device of this server (vrpn_OpenHaptics, vrpn_Phantom): skipped");
    return std::nullopt;
  }
  line.form(openHaptics ? kOpenHaptics : kPhantom);
  return readDevice(line, openHaptics, remarks);
}

}  // namespace

ServerConfig parseVrpnCfg(const std::string& text, const std::string& source,
                          std::vector<std::string>& remarks) {
  ServerConfig config;
  config.devices.clear();
  std::istringstream in(text);
  std::string bytes;
  for (int number = 1; std::getline(in, bytes); ++number) {
    if (number == 1 && bytes.starts_with("\xEF\xBB\xBF")) bytes.erase(0, 3);
    const std::string where = source + ":" + std::to_string(number) + ": ";
    Line line(bytes, where);
    const auto device = readLine(line, remarks);
    if (!device) continue;
    config.devices.push_back(*device);
    try {
      validate(config);
    } catch (const InvalidValue& error) {
      throw ConfigError(where + error.what());
    }
  }
  if (config.devices.empty()) {
    throw ConfigError(source + ": no line names a device of this server; one reads " + kOpenHaptics);
  }
  return config;
}

}  // namespace hapticd::server

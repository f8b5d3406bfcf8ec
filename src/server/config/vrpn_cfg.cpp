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

// One line, read word by word.
class Line {
 public:
  Line(std::string_view text, std::string location) : rest_(text), location_(std::move(location)) { trim(); }

  bool atEnd() const { return rest_.empty() || rest_.front() == '#'; }
  std::string_view word() {
    const std::string_view word = atEnd() ? std::string_view() : rest_.substr(0, rest_.find_first_of(kBlank));
    rest_.remove_prefix(word.size());
    trim();
    return word;
  }
  /// The rest of the line, including spaces.
  std::string rest() const { return atEnd() ? std::string() : std::string(rest_); }

  double number(const char* what, double defaultValue) {
    if (atEnd()) return defaultValue;
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

  const std::string& location() const { return location_; }
  void setFormat(const char* format) { format_ = format; }
  [[noreturn]] void fail(const std::string& text) const {
    throw ConfigError(location_ + text + "; expected format: " + format_);
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
  std::string location_;
  const char* format_ = "";
};

DeviceConfig readDevice(Line& line, bool openHaptics, std::vector<std::string>& warnings) {
  DeviceConfig device;
  device.driver = "openhaptics";
  if (line.atEnd()) line.fail("the name is missing");
  device.names = {std::string(line.word())};
  device.calibrate = line.flag(openHaptics ? "reset_position" : "calibrate");
  device.reportRate_Hz = line.number("report_rate_Hz", device.reportRate_Hz);
  if (device.reportRate_Hz > device.servoRate_Hz) {
    std::ostringstream text;
    text << line.location() << "report_rate_Hz must not exceed the servo rate, got " << device.reportRate_Hz
         << ": reports use " << device.servoRate_Hz << " Hz";
    warnings.push_back(text.str());
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

// The device that the line configures; empty for blank lines, comments and, with a warning, devices of other
// kinds.
std::optional<DeviceConfig> readLine(Line& line, std::vector<std::string>& warnings) {
  if (line.atEnd()) return std::nullopt;
  const std::string_view kind = line.word();
  const bool openHaptics = kind == "vrpn_OpenHaptics";
  if (!openHaptics && kind != "vrpn_Phantom") {
    warnings.push_back(
        line.location() + wire::inQuotes(kind) +
        " is not supported by this server (supported: vrpn_OpenHaptics, vrpn_Phantom): skipped");
    return std::nullopt;
  }
  line.setFormat(openHaptics ? kOpenHaptics : kPhantom);
  return readDevice(line, openHaptics, warnings);
}

}  // namespace

ServerConfig parseVrpnCfg(const std::string& text, const std::string& source,
                          std::vector<std::string>& warnings) {
  ServerConfig config;
  config.devices.clear();
  std::istringstream in(text);
  std::string bytes;
  for (int number = 1; std::getline(in, bytes); ++number) {
    if (number == 1 && bytes.starts_with("\xEF\xBB\xBF")) bytes.erase(0, 3);
    const std::string location = source + ":" + std::to_string(number) + ": ";
    Line line(bytes, location);
    const auto device = readLine(line, warnings);
    if (!device) continue;
    config.devices.push_back(*device);
    try {
      validate(config);
    } catch (const InvalidValue& error) {
      throw ConfigError(location + error.what());
    }
  }
  if (config.devices.empty()) {
    const std::string remedy =
        warnings.empty() ? std::string("expected format: ") + kOpenHaptics : warnings.front();
    throw ConfigError(source + ": no line configures a device of this server; " + remedy);
  }
  return config;
}

}  // namespace hapticd::server

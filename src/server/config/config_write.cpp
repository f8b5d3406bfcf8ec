#include <toml++/toml.h>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "server/config/config_fields.h"

namespace hapticd::server {
namespace {

// Shortest digits that read back as the same value; toml++ writes 0.1 as 0.10000000000000001.
std::string text(double value) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  return {digits, end};
}

// The shortest number of thousandths that reads back as the same value. Both products round, so it may be a
// neighbour of `value` * 1e3.
std::string thousandths(double value) {
  const auto readsBack = [value](const std::string& digits) {
    double back = 0;
    std::from_chars(digits.data(), digits.data() + digits.size(), back);
    return back * 1e-3 == value;
  };
  const double product = value * 1e3;
  for (int precision = 15; precision < 17; ++precision) {
    char digits[32];
    std::snprintf(digits, sizeof digits, "%.*g", precision, product);
    if (readsBack(digits)) return digits;
  }
  for (const double near : {std::nextafter(product, -HUGE_VAL), std::nextafter(product, HUGE_VAL)})
    if (readsBack(text(near))) return text(near);
  return text(product);
}

std::string quoted(const std::string& value) {
  std::ostringstream out;
  const toml::value<std::string> node(value);
  out << toml::toml_formatter(node, toml::format_flags::none);  // no 'literal' and no multi-line strings
  return out.str();
}

class Writer {
 public:
  void field(const char* key, const std::string& value) { line(key, quoted(value)); }
  void field(const char* key, bool value) { line(key, value ? "true" : "false"); }
  void field(const char* key, std::optional<bool> value) {
    if (value) field(key, *value);
  }
  void field(const char* key, int value) { line(key, std::to_string(value)); }
  void field(const char* key, double value) { line(key, text(value)); }
  void field(const char* key, const std::vector<std::string>& values) { list(key, values, quoted); }
  void names(const char* key, const std::vector<std::string>& values) { field(key, values); }
  void driverKey(const std::string& key, const std::map<std::string, std::string>& values) {
    const auto value = values.find(key);
    field(key.c_str(), value == values.end() ? std::string() : value->second);
  }
  void milli(const char* key, double value) { line(key, thousandths(value)); }
  void listen(const char* key, const std::string& address, std::uint16_t port) {
    field(key, address + ":" + std::to_string(port));
  }
  void workspace(const char* key, const std::vector<double>& box) {
    if (box.empty()) {
      field(key, std::string("device"));
    } else if (std::ranges::equal(box, kPaperWorkspace_mm)) {
      field(key, std::string("paper"));
    } else {
      list(key, box, text);
    }
  }
  template <class Enum, std::size_t N>
  void choice(const char* key, Enum value, const Choices<Enum, N>& choices) {
    for (const auto& [name, choice] : choices) {
      if (choice == value) field(key, std::string(name));
    }
  }

  std::ostringstream out;

 private:
  void line(const char* key, const std::string& value) { out << key << " = " << value << "\n"; }

  template <class T, class F>
  void list(const char* key, const std::vector<T>& values, const F& toText) {
    std::string all;
    for (const T& value : values) all += (all.empty() ? "" : ", ") + toText(value);
    line(key, "[" + all + "]");
  }
};

}  // namespace

std::string toToml(const ServerConfig& config) {
  Writer writer;
  visitFields(writer, config);
  writer.out << "\n[compat]\n";
  visitFields(writer, config.compat);
  writer.out << "\n[limits]\n";
  visitFields(writer, config.limits);
  for (const DeviceConfig& device : config.devices) {
    writer.out << "\n[[device]]\n";
    visitFields(writer, device);
  }
  return writer.out.str();
}

}  // namespace hapticd::server

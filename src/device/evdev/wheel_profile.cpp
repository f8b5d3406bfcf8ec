#include "device/evdev/wheel_profile.h"

#include <toml++/toml.h>
#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/nearest_name.h"
#include "base/world.h"

namespace hapticd::device {
namespace {

class Reader {
 public:
  Reader(const toml::table& table, std::string file) : table_(table), file_(std::move(file)) {}

  void number(const char* name, double& value, double least, double most) {
    const toml::node* node = take(name);
    if (node == nullptr) return;
    const auto given = node->value<double>();
    if (!given || !(*given >= least && *given <= most)) fail(*node, name, "a number", least, most);
    value = *given;
  }
  void wholeNumber(const char* name, int& value, int least, int most) {
    double number = value;
    this->number(name, number, least, most);
    if (number != std::floor(number)) fail(*table_.get(name), name, "a whole number", least, most);
    value = static_cast<int>(number);
  }
  void flag(const char* name, bool& value) {
    const toml::node* node = take(name);
    if (node == nullptr) return;
    if (!node->is_boolean())
      throw WheelProfileError(placeOf(*node) + name + " must be true or false, got " + textOf(*node));
    value = *node->value<bool>();
  }
  void finish() const {
    for (const auto& [key, node] : table_) {
      const std::string name(key.str());
      if (std::find(known_.begin(), known_.end(), name) != known_.end()) continue;
      const std::optional<std::string> nearest = base::nearestName(name, known_);
      std::string keys;
      for (const std::string& known : known_) keys += (keys.empty() ? "use " : ", ") + known;
      throw WheelProfileError(placeOf(node) + "unknown key '" + name + "'; " +
                              (nearest ? "did you mean '" + *nearest + "'?" : keys));
    }
  }

 private:
  const toml::node* take(const char* name) {
    known_.emplace_back(name);
    return table_.get(name);
  }
  std::string placeOf(const toml::node& node) const {
    return file_ + ":" + std::to_string(node.source().begin.line) + ": ";
  }
  static std::string textOf(const toml::node& node) {
    std::ostringstream text;
    node.visit([&](const auto& value) { text << value; });
    return text.str();
  }
  [[noreturn]] void fail(const toml::node& node, const char* name, const char* what, double least,
                         double most) const {
    std::ostringstream text;
    text << placeOf(node) << name << " must be " << what << " from " << least << " to " << most << ", got "
         << textOf(node);
    throw WheelProfileError(text.str());
  }

  const toml::table& table_;
  const std::string file_;
  std::vector<std::string> known_;
};

}  // namespace

WheelProfile WheelProfile::load(const std::filesystem::path& file) {
  WheelProfile profile;
  try {
    const std::vector<std::byte> bytes = base::world().files.read(file);
    const toml::table table = toml::parse(
        std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()), file.string());
    Reader reader(table, file.string());
    reader.number("force_N", profile.force_N, 0.05, 100);
    profile.continuousForce_N = 0.5 * profile.force_N;
    reader.number("continuous_force_N", profile.continuousForce_N, 0.05, profile.force_N);
    reader.number("travel_x_m", profile.travelX_m, 0.01, 3);
    reader.number("travel_z_m", profile.travelZ_m, 0.01, 3);
    reader.number("stiffness_N_per_m", profile.stiffness_N_per_m, 1, 5000);
    reader.number("damper", profile.damper, 0, 1);
    reader.flag("invert_force", profile.invertForce);
    reader.wholeNumber("axes", profile.axes, 0, 2);
    reader.finish();
  } catch (const toml::parse_error& error) {
    throw WheelProfileError(file.string() + ":" + std::to_string(error.source().begin.line) + ": " +
                            std::string(error.description()));
  } catch (const std::system_error& error) {
    throw WheelProfileError(error.what());
  }
  profile.measured = true;
  return profile;
}

}  // namespace hapticd::device

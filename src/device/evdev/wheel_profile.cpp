#include "device/evdev/wheel_profile.h"

#include <toml++/toml.h>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

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
    if (!given || !(*given >= least && *given <= most)) {
      fail(name, "must be a number from " + std::to_string(least) + " to " + std::to_string(most));
    }
    value = *given;
  }
  void flag(const char* name, bool& value) {
    const toml::node* node = take(name);
    if (node == nullptr) return;
    if (!node->is_boolean()) fail(name, "must be true or false");
    value = *node->value<bool>();
  }
  void finish() const {
    if (taken_ == table_.size()) return;
    throw WheelProfileError(file_ + ": unknown key");
  }

 private:
  const toml::node* take(const char* name) {
    const toml::node* node = table_.get(name);
    taken_ += node != nullptr ? 1 : 0;
    return node;
  }
  [[noreturn]] void fail(const char* name, const std::string& what) const {
    throw WheelProfileError(file_ + ": " + name + " " + what);
  }

  const toml::table& table_;
  const std::string file_;
  std::size_t taken_ = 0;
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
    double axes = 0;
    reader.number("axes", axes, 0, 2);
    profile.axes = static_cast<int>(axes);
    reader.finish();
  } catch (const toml::parse_error& error) {
    throw WheelProfileError(file.string() + ": " + std::string(error.description()));
  } catch (const std::system_error& error) {
    throw WheelProfileError(error.what());
  }
  profile.measured = true;
  return profile;
}

}  // namespace hapticd::device

#include "server/compat/haply_messages.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "wire/text.h"

namespace hapticd::server::haply {
namespace {

using Json = nlohmann::json;

Json vector(const Vec3& v) {
  return {{"x", v.x()}, {"y", -v.z()}, {"z", v.y()}};
}

Json quaternion(const geometry::Quat& q) {
  Json json = vector(q.vec());
  json["w"] = q.w();
  return json;
}

bool works(const device::DeviceState& state) {
  return (state.hold & ~std::uint32_t{device::kHoldNotCalibrated}) == 0;
}

Json arm(const ShownDevice& shown, bool config) {
  const device::DeviceState& state = shown.state;
  const Json place = vector(state.position_m);
  Json json{{"device_id", shown.id},
            {"state",
             {{"cursor_position", place},
              {"cursor_velocity", vector(state.velocity_m_per_s)},
              {"current_cursor_position", place},
              {"current_cursor_force", vector(shown.force_N)},
              {"body_orientation", quaternion(geometry::Quat::Identity())},
              {"control_domain", "cartesian"},
              {"control_mode", shown.inUse ? "force" : "idle"},
              {"mode", shown.inUse ? "force" : "idle"}}},
            {"status",
             {{"calibrated", (state.hold & device::kHoldNotCalibrated) == 0},
              {"in_use", shown.inUse},
              {"power_supply", true},
              {"ready", works(state) && !shown.isOff},
              {"started", true}}}};
  if (config) {
    json["config"] = {{"type", "inverse3"},
                      {"device_info", {{"id", shown.id}}},
                      {"extended_device_id", shown.id},
                      {"handedness", "right"},
                      {"basis", {{"permutation", "XYZ"}}}};
  }
  return json;
}

// Clients name the buttons by letters or by numbers.
Json grip(const ShownDevice& shown, bool config) {
  constexpr const char* kButtons[][2] = {
      {"a", "button_0"}, {"b", "button_1"}, {"c", "button_2"}, {"d", "button_3"}};
  Json buttons = Json::object();
  for (std::uint32_t i = 0; i < std::size(kButtons); ++i) {
    for (const char* name : kButtons[i]) buttons[name] = (shown.state.buttons >> i & 1U) != 0;
  }
  const std::string id = shown.id + ".grip";
  Json json{{"device_id", id},
            {"state", {{"orientation", quaternion(shown.state.orientation)}, {"buttons", buttons}}},
            {"status", {{"connected", true}, {"ready", works(shown.state)}}}};
  if (config) json["config"] = {{"type", "wireless_verse_grip"}, {"device_info", {{"id", id}}}};
  return json;
}

Vec3 vectorFrom(const Json& command) {
  // "vector" since 3.5, "values" before.
  const auto named = command.find("vector");
  const Json& json = named != command.end() ? *named : command.at("values");
  return {json.at("x").get<double>(), json.at("z").get<double>(), -json.at("y").get<double>()};
}

void ignore(Commands& commands, const std::string& name) {
  if (std::find(commands.ignored.begin(), commands.ignored.end(), name) != commands.ignored.end()) return;
  constexpr std::size_t kMost = 16;
  if (commands.ignored.size() < kMost) commands.ignored.push_back(name);
}

void readDevice(const Json& device, Commands& commands) {
  const std::string id = device.at("device_id").get<std::string>();
  const auto wanted = device.find("commands");
  if (wanted == device.end()) return;
  for (const auto& [name, command] : wanted->items()) {
    if (name.starts_with("probe_")) continue;  // every frame has the newest state
    if (name != "set_cursor_force") {
      ignore(commands, name);
      continue;
    }
    const Vec3 force = vectorFrom(command);
    const auto same = std::find_if(commands.forces.begin(), commands.forces.end(),
                                   [&](const WantedForce& other) { return other.device == id; });
    if (same == commands.forces.end()) {
      commands.forces.push_back({id, force});
    } else {
      same->force_N += force;
    }
  }
}

}  // namespace

std::string stateFrame(std::uint32_t session, const std::vector<ShownDevice>& devices, bool config) {
  Json arms = Json::array();
  Json grips = Json::array();
  for (const ShownDevice& device : devices) {
    arms.push_back(arm(device, config));
    grips.push_back(grip(device, config));
  }
  return Json{{"session_id", session}, {"inverse3", arms}, {"wireless_verse_grip", grips}}.dump(
      -1, ' ', false, Json::error_handler_t::replace);
}

Commands parseCommands(std::string_view text) {
  Commands commands;
  try {
    const Json message = Json::parse(text);
    if (!message.is_object()) throw MessageError("a message must be a JSON object");
    for (const auto& [kind, content] : message.items()) {
      if (kind == "inverse3") {
        for (const Json& device : content) readDevice(device, commands);
      } else if (kind == "session") {
        commands.wantsConfig = content.is_object() && content.contains("force_render_full_state");
      } else if (kind != "wireless_verse_grip" && kind != "verse_grip") {  // of a grip only probes exist
        ignore(commands, kind);
      }
    }
  } catch (const Json::exception& error) {
    const std::string what = error.what();  // "[json.exception.NAME] TEXT"
    throw MessageError(what.substr(what.find("] ") + 2));
  }
  return commands;
}

}  // namespace hapticd::server::haply

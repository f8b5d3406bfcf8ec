#include "device/haply/haply_messages.h"

#include <nlohmann/json.hpp>

namespace hapticd::device::haply {
namespace {

using Json = nlohmann::json;

// Service's frame: x right, y away from the user, z up.
Vec3 fromService(const Vec3& v) noexcept {
  return {v.x(), v.z(), -v.y()};
}

Vec3 vectorOf(const Json& json) {
  const Vec3 v(json.at("x").get<double>(), json.at("y").get<double>(), json.at("z").get<double>());
  if (!v.allFinite()) throw MessageError("a vector that is not finite: " + json.dump());
  return fromService(v);
}

void readGrip(const Json& message, DeviceState& state) {
  for (const char* kind : {"verse_grip", "wireless_verse_grip"}) {
    const auto grips = message.find(kind);
    if (grips == message.end() || grips->empty()) continue;
    const Json& said = grips->at(0).at("state");
    if (const auto q = said.find("orientation"); q != said.end()) {
      const Vec3 axis = vectorOf(*q);
      const Quat turn(q->at("w").get<double>(), axis.x(), axis.y(), axis.z());
      if (turn.norm() > 0.5) state.orientation = turn.normalized();
    }
    if (const auto buttons = said.find("buttons"); buttons != said.end()) {
      constexpr const char* kNames[][2] = {
          {"a", "button_0"}, {"b", "button_1"}, {"c", "button_2"}, {"", "button_3"}};
      for (std::uint32_t i = 0; i < std::size(kNames); ++i) {
        for (const char* name : kNames[i]) {
          if (buttons->value(name, false)) state.buttons |= 1U << i;
        }
      }
    }
    return;
  }
}

// Some versions omit a field; only an explicit "false" holds the force.
std::uint32_t holdsOf(const Json& device) {
  std::uint32_t hold = kHoldNone;
  const auto status = device.find("status");
  if (status == device.end() || !status->is_object()) return hold;
  const auto lacks = [&](const char* name) {
    const auto field = status->find(name);
    return field != status->end() && field->is_boolean() && !field->get<bool>();
  };
  if (lacks("calibrated")) hold |= kHoldNotCalibrated;
  if (lacks("ready") || lacks("power_supply")) hold |= kHoldDeadMan;
  return hold;
}

void checkBasis(const Json& device) {
  const auto config = device.find("config");
  if (config == device.end() || !config->contains("basis")) return;
  const std::string permutation = config->at("basis").value("permutation", "XYZ");
  if (permutation != "XYZ") {
    throw MessageError("the service is set to the basis '" + permutation + "'; this driver reads XYZ");
  }
}

}  // namespace

std::optional<Message> parseMessage(std::string_view text, const std::string& wantedId) {
  try {
    const Json message = Json::parse(text);
    const auto devices = message.find("inverse3");
    if (devices == message.end()) return std::nullopt;
    for (const Json& device : *devices) {
      Message result;
      result.deviceId = device.at("device_id").get<std::string>();
      if (!wantedId.empty() && result.deviceId != wantedId) continue;
      checkBasis(device);
      const Json& state = device.at("state");
      result.state.position_m = vectorOf(state.at("cursor_position"));
      result.state.velocity_m_per_s = vectorOf(state.at("cursor_velocity"));
      result.state.hold = holdsOf(device);
      readGrip(message, result.state);
      return result;
    }
    return std::nullopt;
  } catch (const Json::exception& error) {
    throw MessageError(error.what());
  }
}

std::string forceMessage(const std::string& deviceId, const Vec3& f) {
  const Json values{{"x", f.x()}, {"y", -f.z()}, {"z", f.y()}};
  const Json device{{"device_id", deviceId}, {"commands", {{"set_cursor_force", {{"values", values}}}}}};
  return Json{{"inverse3", Json::array({device})}}.dump();
}

}  // namespace hapticd::device::haply

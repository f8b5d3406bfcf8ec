#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/time.h"
#include "server/reports/client_tick.h"
#include "server/web/state_report.h"
#include "wire/messages.h"

namespace hapticd::server {
namespace {

using Json = nlohmann::ordered_json;

Json json(const geometry::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

// Column-major, as three.js stores matrices.
Json json(const geometry::Affine& t) {
  Json numbers = Json::array();
  const Eigen::Matrix4d m = Eigen::Affine3d(t).matrix();
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) numbers.push_back(m(row, column));
  }
  return numbers;
}

template <class T>
Json orNull(const std::optional<T>& value) {
  return value ? Json(*value) : Json();
}

double inMicroseconds(base::Nanos t) {
  return static_cast<double>(t) * 1e-3;
}

Json json(const base::Histogram::Copy& h) {
  Json bins = Json::array();
  for (int i = 0; i < base::Histogram::kBuckets; ++i) {
    const std::uint64_t count = h.counts[static_cast<std::size_t>(i)];
    if (count == 0) continue;
    const base::Nanos from = i == 0 ? 0 : base::Histogram::upperBound(i - 1) + 1;
    bins.push_back({inMicroseconds(from), count});
  }
  return {{"p50", inMicroseconds(h.quantile(0.5))},
          {"p99", inMicroseconds(h.quantile(0.99))},
          {"p999", inMicroseconds(h.quantile(0.999))},
          {"max", inMicroseconds(h.max)},
          {"bins", std::move(bins)}};
}

Json tripNames(std::uint32_t bits) {
  Json names = Json::array();
  for (const realtime::TripInfo& trip : realtime::kTrips) {
    if ((bits & realtime::bit(trip.trip)) != 0) names.push_back(trip.name);
  }
  return names;
}

Json json(const DeviceStatus& device) {
  const realtime::TickReport& last = device.last;
  const geometry::Affine T_world_device =
      last.tick == 0 ? scene::Workspace{}.T_world_device : last.T_world_device;
  return {{"name", device.names.front()},
          {"names", device.names},
          {"driver", device.driver},
          {"simulated", device.simulated},
          {"scene", device.scene},
          {"workspace_m", {{"min", json(device.workspace_m.min)}, {"max", json(device.workspace_m.max)}}},
          {"T_world_device", json(T_world_device)},
          {"world_per_reported", kWorldPerReported},
          {"peak_force_N", device.peakForce_N},
          {"limit_N", last.guard.limit_N},
          {"rate_Hz", device.rate_Hz},
          {"realtime", device.realtime},
          {"hand", device.hand},
          {"held_by", orNull(device.heldBy)},
          {"fault", device.fault},
          {"temperature", last.device.motorTemperature},
          {"guard",
           {{"armed", last.guard.armed},
            {"stopped", last.guard.stopped},
            {"active", tripNames(last.guard.active)},
            {"latched", tripNames(last.guard.latched)}}},
          {"loop",
           {{"ticks", last.tick},
            {"overruns", last.timing.overruns},
            {"skipped_periods", last.timing.skippedPeriods},
            {"dropped_reports", device.droppedReports},
            {"period_us", json(device.period)},
            {"wakeup_us", json(device.wakeup)},
            {"compute_us", json(device.compute)}}}};
}

Json json(const ClientStatus& client) {
  return {{"id", client.id},
          {"address", client.address},
          {"mode", client.mode},
          {"role", client.role},
          {"devices", client.devices},
          {"connected_s", client.connected_s},
          {"rate_Hz", client.rate_Hz},
          {"bytes_in", client.bytesIn},
          {"bytes_out", client.bytesOut},
          {"dropped", client.dropped},
          {"ignored_datagrams", client.ignoredDatagrams},
          {"queued_bytes", client.queuedBytes},
          {"unacknowledged_bytes", client.unacknowledgedBytes},
          {"commands", client.commands}};
}

Json json(const scene::ObjectDescription& object, std::uint64_t geometry, std::size_t displayTriangles) {
  return {{"id", object.id},
          {"name", object.name},
          {"parent", object.parent},
          {"touchable", object.touchable},
          {"world_units", object.worldUnits},
          {"vertices", object.vertices ? object.vertices->size() : 0},
          {"triangles", object.triangles ? object.triangles->size() : 0},
          {"geometry", geometry},
          {"display_triangles", displayTriangles},
          {"T_world_object", json(object.T_world_object)},
          {"T_parent_object", json(object.T_parent_object)},
          {"T_object_mesh", json(object.T_object_mesh)},
          {"stiffness_N_per_m", object.surface.stiffness_N_per_m},
          {"damping_Ns_per_m", object.surface.damping_Ns_per_m},
          {"static_friction", object.surface.staticFriction},
          {"dynamic_friction", object.surface.dynamicFriction},
          {"popthrough", object.surface.popthrough_N},
          {"mass_kg", object.surface.mass_kg}};
}

Json json(const scene::EffectDescription& described) {
  const scene::Effect& effect = described.effect;
  return {{"index", effect.index},
          {"type", scene::nameOf(effect.type)},
          {"active", described.active},
          {"magnitude_N", effect.magnitude_N},
          {"gain", effect.gain / 1000},  // N/mm, the unit on the wire
          {"duration_ms", base::toSeconds(effect.duration) * 1e3},
          {"frequency_Hz", effect.angularFrequency_rad_per_s / (2 * std::numbers::pi)},
          {"position", json(effect.position)},
          {"direction", json(effect.direction)}};
}

Json json(const scene::Plane& plane) {
  return {{"index", plane.index},
          {"plane", {plane.normal.x(), plane.normal.y(), plane.normal.z(), plane.offset}},
          {"stiffness_N_per_m", plane.surface.stiffness_N_per_m},
          {"damping_Ns_per_m", plane.surface.damping_Ns_per_m},
          {"static_friction", plane.surface.staticFriction},
          {"dynamic_friction", plane.surface.dynamicFriction}};
}

Json json(const scene::ForceField& field) {
  Json jacobian = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) jacobian.push_back(field.jacobian_N_per_unit(row, column));
  }
  return {{"origin", json(field.origin)},
          {"force_N", json(field.force_N)},
          {"jacobian_N_per_unit", std::move(jacobian)},
          {"radius", std::isfinite(field.radius) ? Json(field.radius) : Json()}};
}

Json json(const std::optional<scene::ConstraintDescription>& constraint) {
  if (!constraint) return nullptr;
  return {{"mode", constraint->mode},
          {"point", json(constraint->point)},
          {"direction", json(constraint->direction)},
          {"stiffness_N_per_m", constraint->stiffness_N_per_m}};
}

template <class List>
Json jsonList(const List& list) {
  Json out = Json::array();
  for (const auto& item : list) out.push_back(json(item));
  return out;
}

Json json(const scene::Surface& surface) {
  return {{"stiffness_N_per_m", surface.stiffness_N_per_m},
          {"damping_Ns_per_m", surface.damping_Ns_per_m},
          {"static_friction", surface.staticFriction},
          {"dynamic_friction", surface.dynamicFriction},
          {"popthrough", surface.popthrough_N}};
}

// Empty until the scene has replied for the first time.
Json json(const SceneReport& report, const std::vector<std::string>& devices) {
  static const scene::SceneDescription kNothing;
  const scene::SceneDescription& scene = report.observed ? *report.observed->description : kNothing;
  Json objects = Json::array();
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    objects.push_back(json(scene.objects[i], report.observed->geometry[i], report.displayTriangles[i]));
  }
  return {
      {"devices", devices},
      {"revision", scene.revision},
      {"T_world_scene", json(scene.T_world_scene)},
      {"objects", std::move(objects)},
      {"surface_at_1", report.observed ? json(scene.surfaceAtOne) : Json()},
      {"vibration_contact_unit", scene.contactVibrationUnit == scene::VibrationUnit::hertz ? "Hz" : "rad/s"},
      {"effects", jsonList(scene.effects)},
      {"planes", jsonList(scene.planes)},
      {"constraint", json(scene.constraint)},
      {"fields", jsonList(scene.fields)}};
}

Json json(const std::vector<std::pair<double, std::string>>& moments) {
  Json list = Json::array();
  for (const auto& [time_s, text] : moments) list.push_back({time_s, text});
  return list;
}

// The time line is null until the file was read once.
Json json(const std::optional<ReplayStatus>& replay) {
  if (!replay) return nullptr;
  Json out = {{"file", replay->file},     {"position_s", replay->position_s}, {"speed", replay->speed},
              {"paused", replay->paused}, {"ended", replay->ended},           {"loop", replay->loop},
              {"duration_s", nullptr},    {"contacts", Json::array()},        {"trips", Json::array()},
              {"markers", Json::array()}};
  if (const TimeLine* line = replay->timeLine.get()) {
    out["duration_s"] = line->duration_s;
    for (const auto& [from, to] : line->contacts) out["contacts"].push_back({from, to});
    out["trips"] = json(line->trips);
    out["markers"] = json(line->markers);
  }
  return out;
}

// Names may contain any bytes, JSON is UTF-8: replace what is not.
std::string textOf(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::string stateJson(const StateReport& report) {
  const ServerStatus& server = report.server;
  Json scenes = Json::array();
  for (std::size_t i = 0; i < report.scenes.size(); ++i) {
    scenes.push_back(json(report.scenes[i], server.scenes[i]));
  }
  return textOf({{"server",
                  {{"version", report.version},
                   {"run", server.run},
                   {"uptime_s", server.uptime_s},
                   {"recording", server.recording.empty() ? Json() : Json(server.recording)},
                   {"replay", json(server.replay)}}},
                 {"devices", jsonList(server.devices)},
                 {"clients", jsonList(server.clients)},
                 {"scenes", std::move(scenes)}});
}

std::string messagesJson() {
  Json messages = Json::array();
  for (std::size_t i = 0; i < wire::kMessageKinds; ++i) {
    const wire::MessageInfo& info = wire::info(static_cast<wire::MessageKind>(i));
    messages.push_back({{"name", info.name},
                        {"to_server", info.direction != wire::Direction::kToClient},
                        {"to_client", info.direction != wire::Direction::kToServer},
                        {"meaning", info.meaning}});
  }
  return textOf({{"messages", std::move(messages)}});
}

std::string faultsOf(const ServerStatus& status) {
  std::string faults;
  for (const DeviceStatus& device : status.devices) {
    if (!device.fault.empty()) faults += "device '" + device.names.front() + "': " + device.fault + '\n';
  }
  return faults;
}

std::string errorJson(std::string_view text) {
  return textOf({{"error", text}}) + '\n';
}

}  // namespace hapticd::server

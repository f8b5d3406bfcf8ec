#include "record/sidecar.h"

#include <ctime>

#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "record/recording_reader.h"
#include "scene/builder.h"

namespace hapticd::record {
namespace {

using Json = nlohmann::ordered_json;

std::string dateOf(Nanos wall_ns) {
  const auto seconds = static_cast<std::time_t>(wall_ns / 1'000'000'000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char text[40];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

// A whole number that JSON's readers keep: they hold integers up to 2^53.
Json exactTime(Nanos wall_ns) {
  return std::to_string(wall_ns);
}

// The surfaces of one scene as they follow from its commands.
class SurfaceList {
 public:
  explicit SurfaceList(const scene::SceneConfig& config) : builder_(without(config)) {}

  void apply(const SceneEvent& event) {
    std::vector<scene::Notice> notices;
    if (event.command) {
      builder_.apply(event.client, scene::SceneCommand(*event.command), event.time, notices);
    } else {
      builder_.clientGone(event.client, event.time);
    }
  }

  void publish(Nanos time, Nanos wallOffset) {
    std::vector<scene::Notice> notices;
    if (!builder_.publish(time, notices)) return;
    for (const scene::ObjectDescription& object : builder_.describe().objects) {
      if (!object.triangles) continue;
      const scene::Surface& s = object.surface;
      const auto key =
          std::tuple(object.name, object.touchable, object.triangles->size(), s.stiffness_N_per_m,
                     s.damping_Ns_per_m, s.staticFriction, s.dynamicFriction, s.popthrough_N);
      const auto known = last_.find(object.id);
      if (known != last_.end() && known->second == key) continue;
      last_.insert_or_assign(object.id, key);
      list_.push_back({{"time_ns", exactTime(time + wallOffset)},
                       {"object", object.id},
                       {"name", object.name},
                       {"touchable", object.touchable},
                       {"triangles", object.triangles->size()},
                       {"stiffness_N_per_m", s.stiffness_N_per_m},
                       {"damping_Ns_per_m", s.damping_Ns_per_m},
                       {"static_friction", s.staticFriction},
                       {"dynamic_friction", s.dynamicFriction},
                       {"popthrough_N", s.popthrough_N}});
    }
  }

  Json take() { return std::move(list_); }

 private:
  static scene::SceneConfig without(scene::SceneConfig config) {
    config.stopwatch = nullptr;
    config.ballTool = false;  // nothing touches it
    return config;
  }

  scene::SceneBuilder builder_;
  std::map<std::int32_t, std::tuple<std::string, bool, std::size_t, double, double, double, double, double>>
      last_;
  Json list_ = Json::array();
};

Json devicesOf(const RecordingHeader& header) {
  Json devices = Json::array();
  for (const RecordedDevice& device : header.devices) {
    const geometry::Box& box = device.sceneConfig.deviceWorkspace_m;
    devices.push_back(
        {{"names", device.names},
         {"driver", device.driver},
         {"model", device.model},
         {"scene", device.scene},
         {"rate_Hz", device.tick.rate_Hz},
         {"nominal_force_N", device.sceneConfig.nominalForce_N},
         {"nominal_stiffness_N_per_m", device.sceneConfig.nominalStiffness_N_per_m},
         {"workspace_m", {box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z()}}});
  }
  return devices;
}

}  // namespace

Sidecar sidecarOf(const std::filesystem::path& recording, const std::function<void()>& beforeEach) {
  RecordingReader reader(recording);
  const RecordingHeader& header = reader.header();
  // One builder for each scene: those of its further devices see the same commands.
  std::map<std::uint32_t, SurfaceList> scenes;
  std::map<std::uint32_t, std::uint32_t> sceneOf;  // of the device that stands for its scene
  for (std::uint32_t i = 0; i < header.devices.size(); ++i) {
    const RecordedDevice& device = header.devices[i];
    if (scenes.try_emplace(device.scene, device.sceneConfig).second) sceneOf[i] = device.scene;
  }
  Json markers = Json::array();
  Nanos first = 0;
  for (RecordingEvent event; reader.next(event);) {
    beforeEach();
    if (const auto* scene = std::get_if<SceneEvent>(&event)) {
      const auto list = scenes.find(scene->scene);
      if (list != scenes.end()) list->second.apply(*scene);
    } else if (const auto* publish = std::get_if<PublishEvent>(&event)) {
      const auto number = sceneOf.find(publish->device);
      if (number != sceneOf.end())
        scenes.at(number->second).publish(publish->time, reader.wallOffsetAt(publish->time));
    } else if (const auto* tick = std::get_if<TickEvent>(&event)) {
      if (first == 0) first = tick->tick.report.time;
    } else if (const auto* marker = std::get_if<MarkerEvent>(&event)) {
      markers.push_back(
          {{"time_ns", exactTime(marker->time + reader.wallOffsetAt(marker->time))}, {"text", marker->text}});
    }
  }
  Json surfaces = Json::object();
  for (auto& [number, list] : scenes) surfaces[std::to_string(number)] = list.take();
  const Json all = {{"recording", recording.filename().string()},
                    {"program", header.program},
                    {"force_law", header.law.number},
                    {"began", first == 0 ? Json() : Json(dateOf(first + reader.wallOffsetAt(first)))},
                    {"devices", devicesOf(header)},
                    {"surfaces_of_scene", std::move(surfaces)},
                    {"markers", std::move(markers)},
                    {"remark", reader.remark()},
                    {"config_toml", header.config}};
  return {all.dump(1, ' ', false, Json::error_handler_t::replace) + '\n', reader.remark()};
}

}  // namespace hapticd::record

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "scene/builder.h"
#include "server/web/state_report.h"

namespace hapticd::server {
namespace {

using nlohmann::json;

TEST(StateJson, NamesOfAnyBytesGiveValidJson) {
  StateReport report;
  DeviceStatus device;
  device.names = {"\xff\xfe \x01"};
  device.fault = "\"\n";
  report.server.devices = {device};
  const json state = json::parse(stateJson(report));
  EXPECT_EQ(state["devices"][0]["fault"], "\"\n");
  EXPECT_EQ(state["devices"][0]["name"], "\uFFFD\uFFFD \x01");
}

json emptySceneWith(const scene::SceneConfig& config) {
  const auto description =
      std::make_shared<const scene::SceneDescription>(scene::SceneBuilder(config).describe());
  const std::size_t objects = description->objects.size();
  StateReport report;
  report.server.scenes = {{"Arm"}};
  report.scenes = {
      {std::make_shared<const ObservedScene>(ObservedScene{description, std::vector<std::uint64_t>(objects)}),
       std::vector<std::size_t>(objects)}};
  return json::parse(stateJson(report))["scenes"][0];
}

TEST(StateJson, NamesTheUnitInWhichAContactVibrationIsSent) {
  for (const auto& [unit, name] :
       {std::pair{scene::VibrationUnit::radPerSecond, "rad/s"}, {scene::VibrationUnit::hertz, "Hz"}}) {
    scene::SceneConfig config;
    config.contactVibrationUnit = unit;
    EXPECT_EQ(emptySceneWith(config)["vibration_contact_unit"], name);
  }
}

TEST(StateJson, HasTheSurfaceThatOneMeansOnThisDevice) {
  const json reference = emptySceneWith({})["surface_at_1"];
  EXPECT_EQ(reference["stiffness_N_per_m"], 500);
  EXPECT_EQ(reference["popthrough"], 3.3);
  scene::SceneConfig config;
  config.materialScale = scene::MaterialScale::device;
  config.nominalStiffness_N_per_m = 2000;
  config.nominalForce_N = 8;
  const json device = emptySceneWith(config)["surface_at_1"];
  EXPECT_EQ(device["stiffness_N_per_m"], 2000);
  EXPECT_EQ(device["damping_Ns_per_m"], 2);
  EXPECT_EQ(device["static_friction"], 1);
  EXPECT_EQ(device["popthrough"], 8);
}

TEST(StateJson, HasTheFrameOfTheScene) {
  scene::SceneDescription description;
  description.T_world_scene = Eigen::Translation3d(1, 2, 3);
  StateReport report;
  report.server.scenes = {{"Arm"}};
  report.scenes = {{std::make_shared<const ObservedScene>(
                        ObservedScene{std::make_shared<const scene::SceneDescription>(description), {}}),
                    {}}};
  const json scene = json::parse(stateJson(report))["scenes"][0];
  EXPECT_EQ(scene["T_world_scene"], json({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1}));
}

TEST(Faults, NameEveryDeviceThatDoesNotWork) {
  ServerStatus status;
  status.devices.resize(3);
  for (std::size_t i = 0; i < 3; ++i) status.devices[i].names = {"Arm" + std::to_string(i)};
  EXPECT_EQ(faultsOf(status), "");
  status.devices[0].fault = "the cable is unplugged";
  status.devices[2].fault = "not calibrated";
  EXPECT_EQ(faultsOf(status), "device 'Arm0': the cable is unplugged\ndevice 'Arm2': not calibrated\n");
}

TEST(ErrorJson, IsValidForAnyBytes) {
  for (const std::string text : {"plain", "a \"quoted\" \\ name", "line\nbreak \x01\x1f", ""}) {
    EXPECT_EQ(json::parse(errorJson(text))["error"], text);
  }
  EXPECT_EQ(json::parse(errorJson("\xff"))["error"], "\uFFFD");
}

}  // namespace
}  // namespace hapticd::server

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

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

// Adds the names of all members at any depth.
void addNames(const json& value, std::set<std::string>& names) {
  if (value.is_object()) {
    for (const auto& [name, member] : value.items()) names.insert(name);
  }
  if (!value.is_structured()) return;
  for (const json& member : value) addNames(member, names);
}

TEST(StateJson, EveryMemberStandsOnThePageOfTheViewer) {
  scene::SceneDescription description = scene::SceneBuilder(scene::SceneConfig{}).describe();
  description.effects.resize(1);
  description.planes.resize(1);
  description.fields.resize(1);
  description.constraint.emplace();
  const std::size_t objects = description.objects.size();
  ASSERT_GE(objects, 1U);
  DeviceStatus device;
  device.names = {"Arm"};
  StateReport report;
  report.server.devices = {device};
  report.server.clients.resize(1);
  report.server.replay.emplace().timeLine = std::make_shared<const TimeLine>();
  report.server.scenes = {{"Arm"}};
  report.scenes = {{std::make_shared<const ObservedScene>(
                        ObservedScene{std::make_shared<const scene::SceneDescription>(description),
                                      std::vector<std::uint64_t>(objects)}),
                    std::vector<std::size_t>(objects)}};
  std::set<std::string> names;
  addNames(json::parse(stateJson(report)), names);
  EXPECT_GE(names.size(), 80U);
  std::ifstream file(HAPTICD_TESTDATA "/../docs/viewer.md");
  const std::string page((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::string described = page.substr(page.find("## The state as JSON"));
  for (const std::string& name : names)
    EXPECT_NE(described.find("`" + name + "`"), std::string::npos) << "docs/viewer.md lacks " << name;
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

// The JSON that the compatible port writes and reads. The driver for the same service is the second reader.
#include "server/compat/haply_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "device/haply/haply_messages.h"

namespace hapticd::server::haply {
namespace {

using nlohmann::json;
using testing::ElementsAre;

ShownDevice shown() {
  ShownDevice device;
  device.id = "Phantom";
  device.state.position_m = {0.01, 0.02, 0.03};
  device.state.velocity_m_per_s = {0.1, 0.2, 0.3};
  device.state.orientation = geometry::Quat(0.5, 0.1, -0.7, 0.5).normalized();
  device.state.buttons = 0b0101;
  device.force_N = {1, 2, 3};
  return device;
}

std::string commandFor(const std::string& device, const char* key, double x, double y, double z) {
  const json values{{"x", x}, {"y", y}, {"z", z}};
  const json arm{{"device_id", device}, {"commands", {{"set_cursor_force", {{key, values}}}}}};
  return json{{"inverse3", json::array({arm})}}.dump();
}

TEST(HaplyFrame, TheDriverOfTheServiceReadsTheSameStateFromIt) {
  for (const bool config : {true, false}) {
    const auto read = device::haply::parseMessage(stateFrame(7, {shown()}, config), "Phantom");
    ASSERT_TRUE(read);
    EXPECT_EQ(read->deviceId, "Phantom");
    EXPECT_TRUE(read->state.position_m.isApprox(shown().state.position_m, 1e-12));
    EXPECT_TRUE(read->state.velocity_m_per_s.isApprox(shown().state.velocity_m_per_s, 1e-12));
    EXPECT_LT(read->state.orientation.angularDistance(shown().state.orientation), 1e-9);
    EXPECT_EQ(read->state.buttons, 0b0101U);
    EXPECT_EQ(read->state.hold, device::kHoldNone);
  }
}

TEST(HaplyFrame, HasTheFieldsAndTheFrameOfTheService) {
  const json frame = json::parse(stateFrame(7, {shown()}, true));
  const json& arm = frame["inverse3"][0];
  EXPECT_EQ(frame["session_id"], 7);
  EXPECT_EQ(arm["state"]["cursor_position"], (json{{"x", 0.01}, {"y", -0.03}, {"z", 0.02}}));
  EXPECT_EQ(arm["state"]["cursor_velocity"], (json{{"x", 0.1}, {"y", -0.3}, {"z", 0.2}}));
  EXPECT_EQ(arm["state"]["current_cursor_force"], (json{{"x", 1.0}, {"y", -3.0}, {"z", 2.0}}));
  EXPECT_EQ(arm["config"]["handedness"], "right");
  EXPECT_EQ(arm["config"]["basis"]["permutation"], "XYZ");
  const json& buttons = frame["wireless_verse_grip"][0]["state"]["buttons"];
  EXPECT_EQ(buttons["a"], true);
  EXPECT_EQ(buttons["b"], false);
  EXPECT_EQ(buttons["button_2"], true);
  EXPECT_FALSE(json::parse(stateFrame(7, {shown()}, false))["inverse3"][0].contains("config"));
}

TEST(HaplyFrame, ADeviceThatTakesNoForceIsNotReady) {
  ShownDevice device = shown();
  device.state.hold = device::kHoldNotCalibrated;
  json status = json::parse(stateFrame(1, {device}, false))["inverse3"][0]["status"];
  EXPECT_EQ(status["calibrated"], false);
  EXPECT_EQ(status["ready"], true);
  device.state.hold = device::kHoldFault;
  status = json::parse(stateFrame(1, {device}, false))["inverse3"][0]["status"];
  EXPECT_EQ(status["calibrated"], true);
  EXPECT_EQ(status["ready"], false);
  device.state.hold = device::kHoldNone;
  device.isOff = true;
  const json frame = json::parse(stateFrame(1, {device}, false));
  EXPECT_EQ(frame["inverse3"][0]["status"]["ready"], false);
  EXPECT_EQ(frame["wireless_verse_grip"][0]["status"]["ready"], true) << "it needs no force";
}

TEST(HaplyCommands, ReadBothFormsOfAForce) {
  for (const char* key : {"values", "vector"}) {
    const Commands commands = parseCommands(commandFor("Phantom", key, 1, 2, 3));
    ASSERT_EQ(commands.forces.size(), 1U) << key;
    EXPECT_EQ(commands.forces[0].device, "Phantom");
    EXPECT_EQ(commands.forces[0].force_N, Vec3(1, 3, -2));
  }
  const Commands own = parseCommands(device::haply::forceMessage("Phantom", {0.1, 0.2, 0.3}));
  ASSERT_EQ(own.forces.size(), 1U);
  EXPECT_EQ(own.forces[0].force_N, Vec3(0.1, 0.2, 0.3)) << "as the driver writes it";
}

TEST(HaplyCommands, ForcesOnOneDeviceAdd) {
  const std::string text = R"({"inverse3":[
    {"device_id":"A","commands":{"set_cursor_force":{"values":{"x":1,"y":0,"z":0}}}},
    {"device_id":"B","commands":{"set_cursor_force":{"values":{"x":5,"y":0,"z":0}}}},
    {"device_id":"A","commands":{"set_cursor_force":{"values":{"x":0,"y":0,"z":2}}}}]})";
  const Commands commands = parseCommands(text);
  ASSERT_EQ(commands.forces.size(), 2U);
  EXPECT_EQ(commands.forces[0].force_N, Vec3(1, 2, 0));
  EXPECT_EQ(commands.forces[1].force_N, Vec3(5, 0, 0));
}

TEST(HaplyCommands, NamesWhatHasNoEffect) {
  const Commands commands = parseCommands(R"({
    "session":{"force_render_full_state":{}}, "navigation":{},
    "inverse3":[{"device_id":"A","commands":{"probe_position":{},"set_transform":{},"set_cursor_position":{}}}],
    "wireless_verse_grip":[{"device_id":"A.grip","commands":{"probe_orientation":{}}}]})");
  EXPECT_TRUE(commands.wantsConfig);
  EXPECT_TRUE(commands.forces.empty());
  EXPECT_THAT(commands.ignored, ElementsAre("set_cursor_position", "set_transform", "navigation"));
}

TEST(HaplyCommands, RefuseWhatIsNoCommand) {
  for (const char* text :
       {"", "3", "[]", "{\"inverse3\":", R"({"inverse3":[3]})", R"({"inverse3":[{"commands":{}}]})",
        R"({"inverse3":[{"device_id":7}]})", "{\"inverse3\":[{\"device_id\":\"\xff\"}]}",
        R"({"inverse3":[{"device_id":"A","commands":{"set_cursor_force":{"values":[1,2,3]}}}]})",
        R"({"inverse3":[{"device_id":"A","commands":{"set_cursor_force":{"values":{"x":"1"}}}}]})"}) {
    EXPECT_THROW(parseCommands(text), MessageError) << text;
  }
}

// The client reads the beginning only, where the JSON library would write its own name.
TEST(HaplyCommands, SayFirstWhatIsWrong) {
  const auto refusal = [](const char* text) -> std::string {
    try {
      parseCommands(text);
    } catch (const MessageError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal("{\"inverse3\":").find("parse error at line 1, column 13: "), 0U);
  EXPECT_EQ(refusal(R"({"inverse3":[{"commands":{}}]})"), "key 'device_id' not found");
  EXPECT_EQ(refusal(R"({"inverse3":[{"device_id":7}]})"), "type must be string, but is number");
  EXPECT_EQ(refusal("3"), "a message must be a JSON object");
}

}  // namespace
}  // namespace hapticd::server::haply

// The service's JSON, in both directions.
#include "device/haply/haply_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace hapticd::device::haply {
namespace {

using testing::HasSubstr;

constexpr const char* kState = R"({"session_id": 4, "inverse3": [
  {"device_id": "0123", "state": {"cursor_position": {"x": 0.01, "y": 0.02, "z": 0.03},
                                  "cursor_velocity": {"x": 0.1, "y": 0.2, "z": 0.3}}},
  {"device_id": "4567", "state": {"cursor_position": {"x": 1, "y": 2, "z": 3},
                                  "cursor_velocity": {"x": 0, "y": 0, "z": 0}}}],
  "wireless_verse_grip": [{"device_id": "g", "state": {"orientation": {"x": 0, "y": 1, "z": 0, "w": 0},
                                                       "buttons": {"button_0": true, "button_3": true}}}]})";

std::string refusal(const std::string& text) {
  try {
    parseMessage(text, "");
    return "taken";
  } catch (const MessageError& error) {
    return error.what();
  }
}

TEST(HaplyMessages, StateComesInOurFrame) {
  const auto message = parseMessage(kState, "");
  ASSERT_TRUE(message);
  EXPECT_EQ(message->deviceId, "0123");
  EXPECT_TRUE(message->state.position_m.isApprox(Vec3(0.01, 0.03, -0.02))) << "right, up, to the user";
  EXPECT_TRUE(message->state.velocity_m_per_s.isApprox(Vec3(0.1, 0.3, -0.2)));
  // Half a turn about the service's y is half a turn about our z.
  EXPECT_TRUE((message->state.orientation * Vec3::UnitX()).isApprox(Vec3(-1, 0, 0)));
  EXPECT_TRUE((message->state.orientation * Vec3::UnitZ()).isApprox(Vec3(0, 0, 1)));
  EXPECT_EQ(message->state.buttons, 9U);
  EXPECT_EQ(message->state.hold, kHoldNone);
}

TEST(HaplyMessages, TheWantedDeviceIsTaken) {
  EXPECT_EQ(parseMessage(kState, "4567")->state.position_m.x(), 1);
  EXPECT_FALSE(parseMessage(kState, "89AB"));
  EXPECT_FALSE(parseMessage(R"({"session_id": 1})", ""));
}

TEST(HaplyMessages, NonsenseIsRefusedInWords) {
  EXPECT_THAT(refusal("{"), HasSubstr("parse error"));
  EXPECT_THAT(refusal(R"({"inverse3": [{"device_id": 7}]})"), HasSubstr("string"));
  EXPECT_THAT(refusal(R"({"inverse3": [{"device_id": "a", "state": {}}]})"), HasSubstr("cursor_position"));
  EXPECT_THAT(refusal(R"({"inverse3": [{"device_id": "a", "state": {"cursor_position": {"x": 1e999}}}]})"),
              testing::Not("taken"));
}

TEST(HaplyMessages, ForceGoesInTheServicesFrame) {
  const auto json = nlohmann::json::parse(forceMessage("0123", Vec3(1, 2, 3)));
  const auto& device = json.at("inverse3").at(0);
  EXPECT_EQ(device.at("device_id"), "0123");
  const auto& values = device.at("commands").at("set_cursor_force").at("values");
  EXPECT_EQ(values.at("x"), 1);
  EXPECT_EQ(values.at("y"), -3);
  EXPECT_EQ(values.at("z"), 2);
}

}  // namespace
}  // namespace hapticd::device::haply

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

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

TEST(ErrorJson, IsValidForAnyBytes) {
  for (const std::string text : {"plain", "a \"quoted\" \\ name", "line\nbreak \x01\x1f", ""}) {
    EXPECT_EQ(json::parse(errorJson(text))["error"], text);
  }
  EXPECT_EQ(json::parse(errorJson("\xff"))["error"], "\uFFFD");
}

}  // namespace
}  // namespace hapticd::server

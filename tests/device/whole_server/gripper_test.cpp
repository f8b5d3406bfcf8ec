// The opening of a gripper, from the vendor's library to a client that knows only VRPN's analog device.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "device/whole_server/in_contact.h"

namespace hapticd::whole_server {
namespace {

class Gripper : public InContact, public testing::WithParamInterface<bool> {};

TEST_P(Gripper, IsAnAnalogChannelAndAButton) {
  arm->gripper_rad = 0.4;
  std::vector<std::string> arguments{"--device", "forcedimension"};
  if (GetParam()) arguments.emplace_back("--isolate");
  serve(arguments, {"HAPTICD_DHD_LIB=" MOCK_DRD});
  const LatestReports& latest = visitor->client().latest();
  const auto shows = [&](double angle_rad) {
    return visitor->until([&] {
      const auto& channels = latest.analog.channels;
      return channels.size() == 1 && std::abs(channels[0] - angle_rad) < 1e-9;
    });
  };
  EXPECT_TRUE(shows(0.4)) << server->log();
  arm->gripper_rad = 0.02;
  EXPECT_TRUE(shows(0.02)) << server->log();
  EXPECT_TRUE(visitor->until([&] {
    const auto button = latest.pressed.find(1);
    return button != latest.pressed.end() && button->second;
  })) << "closed";
  EXPECT_NE(server->log().find("7 degrees of freedom in and 7 out, 2 buttons, gripper"), std::string::npos)
      << server->log();
  endInOrder();
}

INSTANTIATE_TEST_SUITE_P(In, Gripper, testing::Bool(), [](const auto& instance) {
  return std::string(instance.param ? "AProcessOfItsOwn" : "TheServer");
});

}  // namespace
}  // namespace hapticd::whole_server

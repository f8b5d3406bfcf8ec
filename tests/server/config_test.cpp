#include "server/config.h"

#include <gtest/gtest.h>

namespace hapticd::server {
namespace {

std::string errorOf(const std::string& text) {
  try {
    parseConfig(text, "test.toml");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(Config, DefaultsAreOneSimulatedPhantomOnLoopback) {
  const ServerConfig config = parseConfig("", "test.toml");
  EXPECT_EQ(config.listenAddress, "127.0.0.1");
  EXPECT_EQ(config.port, 3883);
  ASSERT_EQ(config.devices.size(), 1U);
  EXPECT_EQ(config.devices[0].names, std::vector<std::string>{"Phantom"});
  EXPECT_EQ(config.devices[0].driver, "simulated");
  EXPECT_EQ(config.devices[0].reportRate_Hz, 1000);
  EXPECT_EQ(config.devices[0].linearTolerance_m, 0.001);
}

TEST(Config, ReadsEverySwitch) {
  const ServerConfig config = parseConfig(R"(
listen = "0.0.0.0:4000"
callback_hosts = ["10.0.0.7"]
[[device]]
names = ["Left", "Tracker0"]
report_rate_Hz = 250
linear_tolerance_mm = 0.5
angular_tolerance_rad = 0.1
tool_radius_mm = 2
workspace = "paper"
material_scale = "device"
quaternion_order = "wxyz"
force_report = "normal"
workspace_fit = "enclose"
vibration_contact_unit = "Hz"
vibration_motor_frame = "device"
scene_on_disconnect = "clear"
[[device]]
name = "Right"
workspace = [-1, -2, -3, 4, 5, 6]
)",
                                          "test.toml");
  EXPECT_EQ(config.listenAddress, "0.0.0.0");
  EXPECT_EQ(config.port, 4000);
  EXPECT_EQ(config.callbackHosts, std::vector<std::string>{"10.0.0.7"});
  ASSERT_EQ(config.devices.size(), 2U);
  const DeviceConfig& left = config.devices[0];
  EXPECT_EQ(left.names, (std::vector<std::string>{"Left", "Tracker0"}));
  EXPECT_EQ(left.reportRate_Hz, 250);
  EXPECT_DOUBLE_EQ(left.linearTolerance_m, 0.0005);
  EXPECT_DOUBLE_EQ(left.toolRadius_m, 0.002);
  EXPECT_EQ(left.workspace_mm, (std::vector<double>{-80, -80, -70, 80, 80, 20}));
  EXPECT_EQ(left.materialScale, MaterialScale::device);
  EXPECT_EQ(left.quaternionOrder, QuaternionOrder::wxyz);
  EXPECT_EQ(left.forceReport, ForceReport::normal);
  EXPECT_EQ(left.workspaceFit, WorkspaceFit::enclose);
  EXPECT_EQ(left.vibrationContactUnit, VibrationUnit::hertz);
  EXPECT_EQ(left.vibrationMotorFrame, VibrationFrame::device);
  EXPECT_EQ(left.sceneOnDisconnect, SceneOnDisconnect::clear);
  EXPECT_EQ(config.devices[1].names, std::vector<std::string>{"Right"});
  EXPECT_EQ(config.devices[1].workspace_mm.front(), -1);
}

TEST(Config, ErrorsNameLineKeyValueAndRemedy) {
  EXPECT_EQ(errorOf("listn = \"x\""), "test.toml:1: unknown key 'listn'; did you mean 'listen'?");
  EXPECT_EQ(errorOf("\n[[device]]\nreport_rate_Hz = \"fast\""),
            "test.toml:3: 'report_rate_Hz' is 'fast', expected a number");
  EXPECT_EQ(errorOf("[[device]]\nmaterial_scale = \"big\""),
            "test.toml:2: 'material_scale' is 'big', expected \"reference\" or \"device\"");
  EXPECT_EQ(errorOf("[[device]]\nreport_rate_Hz = 2000"),
            "device 'Phantom': report_rate_Hz is 2000; it must lie between 0.1 and 1000");
  EXPECT_EQ(errorOf("[[device]]\nname=\"A\"\n[[device]]\nname=\"A\""), "the name 'A' is given twice");
  EXPECT_EQ(errorOf("[[device]]\nname=\"A@B\""),
            "device name \"A@B\" must have 1 to 95 characters, no '@' and no control characters");
  EXPECT_EQ(errorOf("[[device]]\nworkspace=[1,2,3]"),
            "device 'Phantom': workspace needs six numbers, min x y z then max x y z, in mm");
  EXPECT_NE(errorOf("listen = ").find("test.toml:1: "), std::string::npos);
  EXPECT_NE(errorOf("listen = \"1.2.3.4:70000\"").find("70000"), std::string::npos);
}

TEST(Config, ValuesThatNoServerCanLiveWithAreNamed) {
  EXPECT_NE(errorOf("seconds = -5").find("seconds is -5"), std::string::npos);
  EXPECT_NE(errorOf("seconds = nan").find("seconds is nan"), std::string::npos);
  EXPECT_NE(errorOf("seconds = 1e300").find("1e+300"), std::string::npos);
  EXPECT_NE(errorOf("callback_hosts = [\"foo bar\"]").find("\"foo bar\""), std::string::npos);
  EXPECT_NE(errorOf("[[device]]\nname=\"a\\nb\"").find("\"a\\x0ab\""), std::string::npos);
  EXPECT_NE(errorOf("[[device]]\nname=\"VRPN Control\"").find("'VRPN Control'"), std::string::npos);
  EXPECT_NE(errorOf("[[device]]\nworkspace=[-1e300,0,0,1,1,1]").find("-1e+300"), std::string::npos);
}

TEST(Config, ListenTakesAddressPortOrBoth) {
  std::string address = "127.0.0.1";
  std::uint16_t port = 3883;
  parseListen(":4000", address, port);
  EXPECT_EQ(address, "127.0.0.1");
  EXPECT_EQ(port, 4000);
  parseListen("0.0.0.0", address, port);
  EXPECT_EQ(address, "0.0.0.0");
  EXPECT_EQ(port, 4000);
  EXPECT_THROW(parseListen("host:", address, port), ConfigError);
  EXPECT_THROW(parseListen("host:12x", address, port), ConfigError);
}

}  // namespace
}  // namespace hapticd::server

#include "server/config/vrpn_cfg.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace hapticd::server {
namespace {

struct Parsed {
  ServerConfig config;
  std::vector<std::string> warnings;
};

Parsed parse(const std::string& text) {
  Parsed parsed;
  parsed.config = parseVrpnCfg(text, "vrpn.cfg", parsed.warnings);
  return parsed;
}

std::string vrpnCfgError(const std::string& text) {
  try {
    parse(text);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

const std::vector<double> kPaper{-80, -80, -70, 80, 80, 20};

TEST(VrpnCfg, ReadsALineOfThePapersServer) {
  const auto [config, warnings] = parse("vrpn_OpenHaptics Phantom0 1 500 0.5 0.05 Default PHANToM\n");
  EXPECT_TRUE(warnings.empty());
  ASSERT_EQ(config.devices.size(), 1U);
  const DeviceConfig& device = config.devices[0];
  EXPECT_EQ(device.names, std::vector<std::string>{"Phantom0"});
  EXPECT_EQ(device.driver, "openhaptics");
  EXPECT_TRUE(device.calibrate);
  EXPECT_FALSE(device.enableForces);
  EXPECT_EQ(device.reportRate_Hz, 500);
  EXPECT_DOUBLE_EQ(device.linearTolerance_m, 0.0005);
  EXPECT_EQ(device.angularTolerance_rad, 0.05);
  EXPECT_EQ(device.hardware, "Default PHANToM");
  EXPECT_EQ(device.workspace_mm, kPaper);
}

TEST(VrpnCfg, ReadsALineOfStockVrpn) {
  const DeviceConfig device = parse("vrpn_Phantom\tPhantom0\t0\t60.0\tDefault PHANToM").config.devices.at(0);
  EXPECT_EQ(device.names, std::vector<std::string>{"Phantom0"});
  EXPECT_EQ(device.driver, "openhaptics");
  EXPECT_FALSE(device.calibrate);
  EXPECT_EQ(device.reportRate_Hz, 60);
  EXPECT_EQ(device.linearTolerance_m, 0.001);
  EXPECT_EQ(device.hardware, "Default PHANToM");
  EXPECT_TRUE(device.workspace_mm.empty());
}

TEST(VrpnCfg, CommentsBlankLinesAndOtherDevicesAreSkipped) {
  const auto [config, warnings] = parse(
      "\xEF\xBB\xBF# our laboratory\r\n"
      "\r\n"
      "   \t \r\n"
      "  #vrpn_Phantom Old 1 60 Default PHANToM\r\n"
      "vrpn_Tracker_NULL Tracker0 2 60.0\r\n"
      "  vrpn_OpenHaptics Left 0 1000 1.0 0.02 Left Device  #2 \r\n"
      "vrpn_Phantom Right 1 1000 Right Device\r\n");
  ASSERT_EQ(config.devices.size(), 2U);
  EXPECT_EQ(config.devices[0].names.front(), "Left");
  EXPECT_EQ(config.devices[0].hardware, "Left Device  #2");
  EXPECT_EQ(config.devices[1].names.front(), "Right");
  EXPECT_EQ(config.devices[1].hardware, "Right Device");
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0],
            "vrpn.cfg:5: \"vrpn_Tracker_NULL\" is not supported by this server (supported: vrpn_OpenHaptics, "
            "vrpn_Phantom): skipped");
}

TEST(VrpnCfg, MissingTrailingValuesHaveDefaults) {
  const DeviceConfig bare = parse("vrpn_OpenHaptics Phantom").config.devices.at(0);
  EXPECT_FALSE(bare.calibrate);
  EXPECT_EQ(bare.reportRate_Hz, 1000);
  EXPECT_DOUBLE_EQ(bare.linearTolerance_m, 0.001);
  EXPECT_EQ(bare.angularTolerance_rad, 0.02);
  EXPECT_EQ(bare.hardware, "");
  EXPECT_EQ(parse("vrpn_Phantom Phantom 1 60 # no name: the first").config.devices.at(0).hardware, "");
}

TEST(VrpnCfg, AReportRateAboveTheServoRateIsReducedWithAWarning) {
  const auto [config, warnings] = parse("\nvrpn_Phantom Phantom 1 5000 X");
  EXPECT_EQ(config.devices.at(0).reportRate_Hz, 1000);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0],
            "vrpn.cfg:2: report_rate_Hz must not exceed the servo rate, got 5000: reports use 1000 Hz");
}

TEST(VrpnCfg, ErrorsNameTheLine) {
  const std::string format = "; expected format: vrpn_Phantom NAME calibrate(0|1) report_rate_Hz DEVICE";
  EXPECT_EQ(vrpnCfgError("#\nvrpn_Phantom"), "vrpn.cfg:2: the name is missing" + format);
  EXPECT_EQ(vrpnCfgError("vrpn_Phantom P yes 60 X"),
            "vrpn.cfg:1: calibrate is \"yes\", expected 0 or 1" + format);
  EXPECT_EQ(vrpnCfgError("vrpn_Phantom P 1 60,0 X"),
            "vrpn.cfg:1: report_rate_Hz is \"60,0\", expected a number" + format);
  EXPECT_EQ(
      vrpnCfgError("\n\nvrpn_OpenHaptics P 1 60 Default PHANToM"),
      "vrpn.cfg:3: linear_tolerance_mm is \"Default\", expected a number; expected format: vrpn_OpenHaptics "
      "NAME reset_position(0|1) report_rate_Hz linear_tolerance_mm angular_tolerance_rad DEVICE");
  EXPECT_EQ(vrpnCfgError("vrpn_Phantom P 1 0 X"),
            "vrpn.cfg:1: device 'P': report_rate_Hz must be between 0.1 and 1000, got 0");
  EXPECT_EQ(vrpnCfgError("vrpn_OpenHaptics P 1 60 -1 0 X"),
            "vrpn.cfg:1: device 'P': linear_tolerance_mm must be between 0 and 1000, got -1");
  EXPECT_EQ(vrpnCfgError("vrpn_OpenHaptics P 1 nan 1 0 X"),
            "vrpn.cfg:1: device 'P': report_rate_Hz must be between 0.1 and 1000, got nan");
  EXPECT_EQ(vrpnCfgError("vrpn_Phantom P 1 60 X\nvrpn_Phantom P 1 60 Y"),
            "vrpn.cfg:2: the name 'P' is used twice; device names must be unique");
  EXPECT_EQ(vrpnCfgError("vrpn_Phantom P@Q 1 60 X"),
            "vrpn.cfg:1: device name \"P@Q\" must have 1 to 95 bytes, no '@' and no control characters");
}

TEST(VrpnCfg, AFileWithoutSupportedDevicesIsAnError) {
  EXPECT_NE(vrpnCfgError("# nothing\n")
                .find("vrpn.cfg: no line configures a device of this server; expected format: vrpn_Open"),
            std::string::npos);
  EXPECT_EQ(
      vrpnCfgError("# a misspelt line\nvrpn_phantom P 1 60 X\nvrpn_Tracker_NULL T 2 60\n"),
      "vrpn.cfg: no line configures a device of this server; vrpn.cfg:2: \"vrpn_phantom\" is not supported "
      "by this server (supported: vrpn_OpenHaptics, vrpn_Phantom): skipped");
}

TEST(VrpnCfg, WrittenAsTomlItReadsBackEqual) {
  const ServerConfig config =
      parse("vrpn_OpenHaptics Left 0 333 0.3 0.02 Left Device\nvrpn_Phantom Right 1 60 \"Right\" \\Device")
          .config;
  EXPECT_EQ(parseConfig(toToml(config), "written"), config);
}

TEST(VrpnCfg, TheFileExtensionSelectsTheFormat) {
  const std::filesystem::path directory = std::filesystem::path(testing::TempDir()) / "vrpn_cfg_test";
  std::filesystem::create_directories(directory);
  std::ofstream(directory / "vrpn.cfg") << "vrpn_Dial Dial0 1 2 3\nvrpn_Phantom P 1 60 X\n";
  std::ofstream(directory / "hapticd.toml") << "listen = \":4000\"\n";
  std::vector<std::string> warnings;
  EXPECT_EQ(loadConfig(directory / "vrpn.cfg", warnings).devices.at(0).names.front(), "P");
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("vrpn.cfg:1: \"vrpn_Dial\""), std::string::npos) << warnings[0];
  EXPECT_EQ(loadConfig(directory / "hapticd.toml", warnings).port, 4000);
  std::ofstream(directory / "VRPN.CFG") << "vrpn_Phantom Q 1 60 X\n";
  EXPECT_EQ(loadConfig(directory / "VRPN.CFG", warnings).devices.at(0).names.front(), "Q");
  std::ofstream(directory / "vrpn.txt") << "# of the laboratory\nvrpn_Phantom P 1 60 X\n";
  try {
    loadConfig(directory / "vrpn.txt", warnings);
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_TRUE(std::string(error.what()).ends_with("; a vrpn.cfg needs a name that ends with .cfg"))
        << error.what();
  }
  EXPECT_THROW(loadConfig(directory / "none.toml", warnings), ConfigError);
  std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace hapticd::server

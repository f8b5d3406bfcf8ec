#include "device/drivers/drivers.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <set>

#include "device/simulated/steered_hand.h"

namespace hapticd::device {
namespace {

std::string refusalOf(const char* driver, const DriverOptions& options) {
  try {
    findDriver(driver)->make(options);
  } catch (const InvalidDriverOption& error) {
    return error.what();
  }
  return "";
}

TEST(Drivers, EachHasAUniqueNameAndIsFoundByIt) {
  std::set<std::string> names;
  for (const Driver* driver : drivers()) {
    EXPECT_TRUE(names.insert(driver->name).second) << driver->name << " is there twice";
    EXPECT_EQ(findDriver(driver->name), driver);
    EXPECT_STRNE(driver->help, "");
  }
  EXPECT_EQ(drivers().size(), 6U);
  EXPECT_STREQ(drivers().front()->name, "simulated") << "the default";
  EXPECT_EQ(findDriver("telepathy"), nullptr);
  EXPECT_EQ(driverNames(), "simulated, openhaptics, forcedimension, haply, evdev, replay");
}

TEST(Drivers, MakeDevicesThatAreNotYetOpen) {
  for (const Driver* driver : drivers()) {
    if (std::string(driver->name) == "replay") continue;
    const auto device = driver->make({});
    ASSERT_NE(device, nullptr) << driver->name;
    EXPECT_EQ(device->traits().selfPaced, std::string(driver->name) == "openhaptics") << driver->name;
  }
}

TEST(Drivers, OnlyTheSimulatedHandCanBeSteeredAndNeedsNoRearm) {
  for (const Driver* driver : drivers()) {
    if (std::string(driver->name) == "replay") continue;
    const auto device = driver->make({});
    const bool simulated = std::string(driver->name) == "simulated";
    EXPECT_EQ(device->steered() != nullptr, simulated) << driver->name;
    EXPECT_EQ(device->traits().needsRearm, !simulated) << driver->name;
    EXPECT_EQ(driver->canBeIsolated, !simulated) << driver->name;
  }
}

TEST(Drivers, ValuesThatADriverDoesNotAcceptAreNamed) {
  EXPECT_EQ(refusalOf("forcedimension", {.hardware = "first"}),
            "hardware is 'first', expected the number of the Force Dimension device, 0 for the first");
  EXPECT_EQ(refusalOf("forcedimension", {.hardware = "1"}), "");
  EXPECT_EQ(refusalOf("replay", {}),
            R"(replay needs a recorded hand: hand = "FILE.csv", or --hand FILE.csv)");
  const std::string file = testing::TempDir() + "drivers_test_replay.csv";
  std::ofstream(file) << "t_s,x_m,y_m,z_m\n0,0,0,0\n";
  EXPECT_EQ(refusalOf("replay", {.hand = file}), "");
  std::remove(file.c_str());
}

TEST(Drivers, KeysOfTheirOwnAreKnown) {
  EXPECT_EQ(driverKeys(), std::vector<std::string>{"wheel_profile"});
}

TEST(Drivers, TheSimulatedHandFollowsAFile) {
  const std::string file = testing::TempDir() + "drivers_test_hand.csv";
  std::ofstream(file) << "t_s,x_m,y_m,z_m\n0,0.01,0.02,0.03\n1,0.01,0.02,0.03\n";
  const auto device = findDriver("simulated")->make({.hand = file});
  std::remove(file.c_str());
  device->open();
  DeviceState state;
  ASSERT_TRUE(device->read(0, state));
  EXPECT_NEAR(state.position_m.x(), 0.01, 1e-12);
  EXPECT_NEAR(state.position_m.z(), 0.03, 1e-12);
}

}  // namespace
}  // namespace hapticd::device

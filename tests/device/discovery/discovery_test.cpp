// What `hapticd devices` tells.
#include "device/discovery/discovery.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "device/discovery/usb_devices.h"
#include "mocks/dhd/mock_dhd_control.h"

namespace hapticd::device {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class DiscoveryTest : public testing::Test {
 protected:
  DiscoveryTest() {
    fs::remove_all(root);
    options.usbDevices = root / "usb";
    options.inputDevices = root / "input";
    options.nodes = root / "dev";
    options.haplyHost = "127.0.0.1";
    options.haplyPort = "1";  // nobody listens there
    setenv("HAPTICD_DHD_LIB", MOCK_BROKEN, 1);
  }
  ~DiscoveryTest() override { fs::remove_all(root); }
  static void write(const fs::path& file, const std::string& text) {
    fs::create_directories(file.parent_path());
    std::ofstream(file) << text << "\n";
  }
  void plugIn(const std::string& place, const std::string& vendor, const std::string& product,
              const std::string& name) const {
    write(options.usbDevices / place / "idVendor", vendor);
    write(options.usbDevices / place / "idProduct", product);
    write(options.usbDevices / place / "product", name);
    write(options.usbDevices / place / "busnum", "1");
    write(options.usbDevices / place / "devnum", "42");
  }
  void joystick(const std::string& name, const std::string& capabilities, const std::string& words) const {
    write(options.nodes / "input" / name, "");
    write(options.inputDevices / name / "device/capabilities/ff", capabilities);
    write(options.inputDevices / name / "device/name", words);
  }
  // As the system would to somebody without rights; root has all.
  void forbid() {
    options.mayUse = [](const fs::path&) { return std::make_error_code(std::errc::permission_denied); };
  }
  DriverReport of(const std::string& driver) const {
    for (const DriverReport& report : findDevices(options)) {
      if (report.driver == driver) return report;
    }
    ADD_FAILURE() << "no report of " << driver;
    return {};
  }

  const fs::path root =
      fs::path(testing::TempDir()) / ("hapticd_" + std::to_string(getpid()) + "_" +
                                      testing::UnitTest::GetInstance()->current_test_info()->name());
  DiscoveryOptions options;
};

TEST_F(DiscoveryTest, UsbDevicesAreFoundByVendor) {
  plugIn("1-1", "1451", "0402", "omega");
  plugIn("1-2", "046d", "c24f", "a wheel");
  fs::create_directories(options.usbDevices / "1-0:1.0");
  const auto found = findUsbDevices(options.usbDevices, "forcedimension");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].text(), "omega (USB 1451:0402)");
  EXPECT_THAT(found[0].nodes, ElementsAre("bus/usb/001/042"));
  EXPECT_THAT(findUsbDevices("/nowhere", "forcedimension"), IsEmpty());
  EXPECT_THAT(findUsbDevices(options.usbDevices, "openhaptics"), IsEmpty());
}

TEST_F(DiscoveryTest, ATouchIsReachedThroughItsSerialLineOrItsHidDevice) {
  // As sysfs has it: a link to the device, and below it a folder for each interface.
  const fs::path there = root / "devices/1-2";
  write(there / "idVendor", "2988");
  write(there / "idProduct", "0302");
  write(there / "1-2:1.0/tty/ttyACM3/dev", "166:3");
  write(there / "1-2:1.1/0003:2988:0302.0001/hidraw/hidraw5/dev", "1:5");
  fs::create_directories(options.usbDevices);
  fs::create_directory_symlink(there, options.usbDevices / "1-2");
  plugIn("1-3", "0301", "0001", "another maker's");
  const auto found = findUsbDevices(options.usbDevices, "openhaptics");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].nodes, ElementsAre("hidraw5", "ttyACM3"));
}

TEST_F(DiscoveryTest, ANodeThatMayNotBeOpenedIsNamedWithTheRuleToInstall) {
  const auto tellsTheRule = AllOf(HasSubstr("packaging/udev/70-hapticd.rules /etc/udev/rules.d/"),
                                  HasSubstr("udevadm control --reload"), HasSubstr("udevadm trigger"));
  setenv("HAPTICD_DHD_LIB", MOCK_DRD, 1);
  setenv("HAPTICD_HDAPI_LIB", MOCK_HD, 1);
  plugIn("1-1", "1451", "0402", "omega");
  plugIn("1-2", "2988", "0302", "Touch");
  joystick("event7", "300040000 0", "Wheel");
  forbid();
  const DriverReport omega = of("forcedimension");
  EXPECT_THAT(omega.reason, AllOf(HasSubstr("dev/bus/usb/001/042: Permission denied"), HasSubstr("omega")));
  EXPECT_THAT(omega.remedy, tellsTheRule);
  const DriverReport touch = of("openhaptics");
  EXPECT_THAT(touch.devices, IsEmpty());
  EXPECT_THAT(touch.reason, HasSubstr("dev/bus/usb/001/042: Permission denied"));
  EXPECT_THAT(touch.remedy, tellsTheRule);
  const DriverReport wheel = of("evdev");
  EXPECT_THAT(wheel.devices, IsEmpty());
  EXPECT_THAT(wheel.reason, AllOf(HasSubstr("Wheel"), HasSubstr("dev/input/event7: Permission denied")));
  EXPECT_THAT(wheel.remedy, tellsTheRule);
}

TEST_F(DiscoveryTest, AMissingLibraryAndMissingRightsAreBothTold) {
  plugIn("1-1", "1451", "0402", "omega");
  forbid();
  const DriverReport report = of("forcedimension");
  EXPECT_THAT(report.reason, AllOf(HasSubstr("Permission denied"), HasSubstr("libhapticd_absent.so.1")));
  EXPECT_THAT(report.remedy, AllOf(HasSubstr("libdrd.so.3"), HasSubstr("70-hapticd.rules")));
}

TEST_F(DiscoveryTest, AKeyboardThatMayNotBeOpenedIsNobodysMatter) {
  joystick("event0", "0", "Keyboard");
  joystick("event1", "107030000 0", "a pad that only rumbles");
  write(options.nodes / "input/event2", "");
  forbid();
  const DriverReport report = of("evdev");
  EXPECT_THAT(report.reason, HasSubstr("no input device here has force feedback"));
  EXPECT_THAT(report.remedy, HasSubstr("connect a joystick"));
}

TEST_F(DiscoveryTest, ADeviceThatIsOffIsNotAMatterOfRights) {
  setenv("HAPTICD_DHD_LIB", MOCK_DRD, 1);
  plugIn("1-1", "1451", "0402", "omega");
  options.mayUse = [](const fs::path&) { return std::error_code(); };
  const auto* mock = reinterpret_cast<const MockDhd* (*)()>(dlsym(dlopen(MOCK_DRD, RTLD_NOW), "mockDhd"))();
  mock->devices(0, "");
  const DriverReport report = of("forcedimension");
  mock->reset();
  EXPECT_THAT(report.reason, AllOf(HasSubstr("omega"), HasSubstr("finds no device")));
  EXPECT_THAT(report.remedy, HasSubstr("switch the device on"));
}

TEST_F(DiscoveryTest, TheSystemIsAskedForTheRights) {
  write(root / "node", "");
  EXPECT_FALSE(mayReadAndWrite(root / "node"));
  EXPECT_EQ(mayReadAndWrite(root / "absent"), std::errc::no_such_file_or_directory);
}

TEST_F(DiscoveryTest, AMissingLibraryIsToldInTheLoadersWordsNextToWhatIsPluggedIn) {
  plugIn("1-1", "1451", "0402", "omega");
  const DriverReport report = of("forcedimension");
  EXPECT_THAT(report.devices, IsEmpty());
  EXPECT_THAT(report.reason, AllOf(HasSubstr("1451:0402"), HasSubstr("libhapticd_absent.so.1")));
  EXPECT_THAT(report.remedy, HasSubstr("libdrd.so.3"));
}

TEST_F(DiscoveryTest, ConnectedArmsAreCounted) {
  setenv("HAPTICD_DHD_LIB", MOCK_DRD, 1);
  const DriverReport report = of("forcedimension");
  EXPECT_THAT(report.devices, ElementsAre("device 0"));
  EXPECT_EQ(report.reason, "");
}

TEST_F(DiscoveryTest, OpenHapticsTellsAfterOpening) {
  setenv("HAPTICD_HDAPI_LIB", MOCK_HD, 1);
  EXPECT_THAT(of("openhaptics").reason, HasSubstr("only opening shows"));
  options.openThem = true;
  EXPECT_THAT(of("openhaptics").devices, ElementsAre(HasSubstr("MOCK-0001")));
}

TEST_F(DiscoveryTest, AServiceThatDoesNotRunIsNamed) {
  const DriverReport report = of("haply");
  EXPECT_THAT(report.reason, HasSubstr("127.0.0.1:1"));
  EXPECT_THAT(report.remedy, HasSubstr("haply-inverse-service"));
}

TEST_F(DiscoveryTest, EveryDriverSaysSomething) {
  for (const DriverReport& report : findDevices(options)) {
    EXPECT_TRUE(!report.devices.empty() || !report.reason.empty()) << report.driver;
  }
}

}  // namespace
}  // namespace hapticd::device

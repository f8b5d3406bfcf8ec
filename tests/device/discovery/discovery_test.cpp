// What `hapticd devices` tells.
#include "device/discovery/discovery.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "device/discovery/usb_devices.h"

namespace hapticd::device {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class DiscoveryTest : public testing::Test {
 protected:
  DiscoveryTest() {
    options.usbDevices =
        std::filesystem::path(testing::TempDir()) /
        (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + "_usb");
    options.haplyHost = "127.0.0.1";
    options.haplyPort = "1";  // nobody listens there
    std::filesystem::remove_all(options.usbDevices);
    setenv("HAPTICD_DHD_LIB", MOCK_BROKEN, 1);
  }
  void plugIn(const std::string& place, const std::string& vendor, const std::string& product,
              const std::string& name) const {
    std::filesystem::create_directories(options.usbDevices / place);
    std::ofstream(options.usbDevices / place / "idVendor") << vendor << "\n";
    std::ofstream(options.usbDevices / place / "idProduct") << product << "\n";
    std::ofstream(options.usbDevices / place / "product") << name << "\n";
  }
  DriverReport of(const std::string& driver) const {
    for (const DriverReport& report : findDevices(options)) {
      if (report.driver == driver) return report;
    }
    ADD_FAILURE() << "no report of " << driver;
    return {};
  }

  DiscoveryOptions options;
};

TEST_F(DiscoveryTest, UsbDevicesAreFoundByVendor) {
  plugIn("1-1", "1451", "0402", "omega");
  plugIn("1-2", "046d", "c24f", "a wheel");
  std::filesystem::create_directories(options.usbDevices / "1-0:1.0");
  const auto found = findUsbDevices(options.usbDevices, {"1451"});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].text(), "omega (USB 1451:0402)");
  EXPECT_THAT(findUsbDevices("/nowhere", {"1451"}), IsEmpty());
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
  EXPECT_THAT(of("openhaptics").reason, HasSubstr("only opening"));
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

#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "net/endpoint.h"
#include "zeroconf/announcer.h"
#include "zeroconf/background_search.h"
#include "zeroconf/find_servers.h"
#include "zeroconf/scripted_avahi.h"

namespace hapticd::zeroconf {
namespace {

using test::AvahiEntry;
using test::ScriptedAvahi;

const std::vector<std::string> kLabText{"txtvers=1", "devices=Phantom,Left", "version=1.2.3", "page=8080",
                                        "tls=1"};

AnnouncedServer lab() {
  return {.name = "hapticd on lab7",
          .port = 3884,
          .devices = {"Phantom", "Left"},
          .pagePort = 8080,
          .tls = true,
          .version = "1.2.3"};
}

TEST(AnnouncedServer, SaysItsDevicesPageAndVersion) {
  EXPECT_EQ(lab().text(), kLabText);
}

TEST(AnnouncedServer, IsReadFromItsText) {
  AnnouncedServer read{.name = "hapticd on lab7", .port = 3884};
  read.read(kLabText);
  EXPECT_EQ(read, lab());
  read.address = "10.0.0.7";
  EXPECT_EQ(read.client("Left"), "Left@10.0.0.7:3884");
  EXPECT_EQ(read.page(), "https://10.0.0.7:8080/") << "both ports require TLS";
  read.tls = false;
  EXPECT_EQ(read.page(), "http://10.0.0.7:8080/");
}

TEST(AnnouncedServer, IsRecognizedByTheServerThatAnnouncedIt) {
  const net::Endpoint everywhere{net::kAnyAddress, 3884};
  const net::Endpoint here{net::kLoopbackAddress, 3884};
  AnnouncedServer found = lab();
  found.address = "127.0.0.1";
  EXPECT_TRUE(listensAt(everywhere, found));
  EXPECT_TRUE(listensAt(here, found));
  found.address = "203.0.113.7";  // of no machine (RFC 5737)
  EXPECT_FALSE(listensAt(everywhere, found));
  EXPECT_FALSE(listensAt(here, found));
  EXPECT_TRUE(listensAt(net::Endpoint::parse("203.0.113.7", 3884), found));
  EXPECT_FALSE(listensAt(net::Endpoint::parse("203.0.113.7", 3885), found)) << "another server of it";
  for (const char* nowhere : {"", "0.0.0.0", "lab7", "127.0.0.1 "}) {
    found.address = nowhere;
    EXPECT_FALSE(listensAt(everywhere, found)) << nowhere;
  }
}

TEST(AnnouncedServer, IgnoresWhatItDoesNotKnow) {
  AnnouncedServer read;
  read.read({"", "=", "devices", "devices=,,A,", "page=70000", "page=x", "version=a=b", "colour=red"});
  EXPECT_EQ(read.devices, std::vector<std::string>{"A"});
  EXPECT_EQ(read.pagePort, 0);
  EXPECT_EQ(read.version, "a=b");
  EXPECT_EQ(read.page(), "");
}

TEST(AnnouncedServer, ItsDevicesMayHaveCommasInTheirNames) {
  AnnouncedServer named = lab();
  named.devices = {"Arm, left", "100%", "%2C", ","};
  AnnouncedServer read;
  read.read(named.text());
  EXPECT_EQ(read.devices, named.devices);
}

// A machine of the network chooses these bytes, and a terminal obeys some.
TEST(AnnouncedServer, HasNoControlCharacters) {
  AnnouncedServer read;
  read.read({"devices=A\x1b[2J,B\r\n",
             "version=1\xc2\x9b"
             "2\x7f"});
  EXPECT_EQ(read.devices, (std::vector<std::string>{"A\xef\xbf\xbd[2J", "B\xef\xbf\xbd\xef\xbf\xbd"}));
  EXPECT_EQ(read.version,
            "1\xef\xbf\xbd"
            "2\xef\xbf\xbd");
}

TEST(AnnouncedServer, LeavesOutDevicesThatDoNotFit) {
  AnnouncedServer many = lab();
  many.devices.assign(40, "ADeviceOfTenBytes");
  for (const std::string& entry : many.text()) EXPECT_LE(entry.size(), 255U);
  AnnouncedServer read;
  read.read(many.text());
  EXPECT_EQ(read.devices.size(), 13U);
}

class Zeroconf : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!bus_.runs()) GTEST_SKIP() << "dbus-daemon is missing (packages.txt, section test)";
  }
  std::vector<AnnouncedServer> find() { return findServers(clock_, base::toNanos(30)); }

  test::PrivateBus bus_;
  base::MonotonicClock clock_;
};

TEST_F(Zeroconf, AServerIsAnnouncedAsItIs) {
  ScriptedAvahi avahi;
  const Announcer announcer(lab(), net::kAnyAddress);
  ASSERT_TRUE(avahi.waitCommitted(1));
  const AvahiEntry entry = avahi.entry();
  EXPECT_EQ(entry.name, "hapticd on lab7");
  EXPECT_EQ(entry.type, "_hapticd._tcp");
  EXPECT_EQ(entry.port, 3884);
  EXPECT_EQ(entry.interface, -1);
  EXPECT_EQ(entry.protocol, 0);
  EXPECT_EQ(entry.text, kLabText);
}

TEST_F(Zeroconf, AServerOfOneAddressIsAnnouncedOnItsInterface) {
  ScriptedAvahi avahi;
  const Announcer announcer(lab(), net::kLoopbackAddress);
  ASSERT_TRUE(avahi.waitCommitted(1));
  EXPECT_EQ(avahi.entry().interface, 1) << "the loopback interface is the first of every Linux";
}

TEST_F(Zeroconf, AnotherNameIsTakenWhenTheMachineHasIt) {
  ScriptedAvahi avahi({"hapticd on lab7", "hapticd on lab7 #2"});
  const Announcer announcer(lab(), net::kAnyAddress);
  ASSERT_TRUE(avahi.waitCommitted(1));
  EXPECT_EQ(avahi.entry().name, "hapticd on lab7 #2 #2");
}

TEST_F(Zeroconf, AnotherNameIsTakenWhenAnotherMachineHasIt) {
  ScriptedAvahi avahi;
  const Announcer announcer(lab(), net::kAnyAddress);
  ASSERT_TRUE(avahi.waitCommitted(1));
  avahi.collide();
  ASSERT_TRUE(avahi.waitCommitted(2));
  EXPECT_EQ(avahi.entry().name, "hapticd on lab7 #2");
}

TEST_F(Zeroconf, AServerIsAnnouncedAgainWhenItsHostIsRenamed) {
  ScriptedAvahi avahi;
  const Announcer announcer(lab(), net::kAnyAddress);
  ASSERT_TRUE(avahi.waitCommitted(1));
  avahi.renameHost();
  ASSERT_TRUE(avahi.waitCommitted(2));
  EXPECT_EQ(avahi.entry().name, "hapticd on lab7");
}

TEST_F(Zeroconf, AServerIsAnnouncedAgainWhenAvahiRestarts) {
  const Announcer announcer(lab(), net::kAnyAddress);  // before any Avahi
  for (int start = 0; start < 3; ++start) {
    ScriptedAvahi avahi;
    ASSERT_TRUE(avahi.waitCommitted(1)) << start;
    EXPECT_EQ(avahi.entry().text, kLabText);
  }
}

TEST_F(Zeroconf, AServerIsAnnouncedAgainWhenTheBusRestarts) {
  const Announcer announcer(lab(), net::kAnyAddress);
  {
    ScriptedAvahi avahi;
    ASSERT_TRUE(avahi.waitCommitted(1));
  }
  bus_.restart();
  ScriptedAvahi avahi;
  ASSERT_TRUE(avahi.waitCommitted(1));
  EXPECT_EQ(avahi.entry().text, kLabText);
}

TEST_F(Zeroconf, ServersOfTheNetworkAreFoundOnce) {
  ScriptedAvahi avahi;
  const AvahiEntry labEntry{2, 0, "hapticd on lab7", "_hapticd._tcp", 3884, kLabText};
  const AvahiEntry labAgain{3, 0, "hapticd on lab7", "_hapticd._tcp", 3884, kLabText};
  // Avahi tells the machine itself of its servers by this address, too, which no other machine can use.
  const AvahiEntry labHere{1, 0, "hapticd on lab7", "_hapticd._tcp", 3884, kLabText};
  const AvahiEntry attic{2, 0, "attic", "_hapticd._tcp", 3883, {"devices=Arm", "version=9"}};
  const AvahiEntry gone{2, -1, "gone", "_hapticd._tcp", 1, {}};
  const AvahiEntry printer{2, 0, "printer", "_ipp._tcp", 631, {}};
  avahi.setOthers({{labHere, "127.0.0.1"},
                   {labEntry, "10.0.0.7"},
                   {gone, ""},
                   {printer, "10.0.0.3"},
                   {labAgain, "10.0.0.7"},
                   {attic, "10.0.0.9"}});
  const std::vector<AnnouncedServer> found = find();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].name, "attic");
  EXPECT_EQ(found[0].client("Arm"), "Arm@10.0.0.9:3883");
  AnnouncedServer expected = lab();
  expected.address = "10.0.0.7";
  EXPECT_EQ(found[1], expected);
}

TEST_F(Zeroconf, NobodyIsFoundInAnEmptyNetwork) {
  ScriptedAvahi avahi;
  EXPECT_TRUE(find().empty());
}

TEST_F(Zeroconf, WithoutAvahiTheRemedyIsTold) {
  try {
    find();
    FAIL() << "found without Avahi";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("apt install avahi-daemon"), std::string::npos) << error.what();
  }
}

// What a search in the background reports.
using Report = std::pair<std::vector<AnnouncedServer>, std::string>;

Report searched(BackgroundSearch& search) {
  std::promise<Report> report;
  search.start([&](std::vector<AnnouncedServer> servers, std::string reason) {
    report.set_value({std::move(servers), std::move(reason)});
  });
  return report.get_future().get();
}

TEST_F(Zeroconf, ASearchInTheBackgroundFindsServersAgainAndAgain) {
  ScriptedAvahi avahi;
  BackgroundSearch search;
  EXPECT_EQ(searched(search), Report());
  avahi.setOthers({{{2, 0, "attic", "_hapticd._tcp", 3883, {"devices=Arm"}}, "10.0.0.9"}});
  const auto [servers, reason] = searched(search);
  EXPECT_EQ(reason, "");
  ASSERT_EQ(servers.size(), 1U);
  EXPECT_EQ(servers[0].client("Arm"), "Arm@10.0.0.9:3883");
}

TEST_F(Zeroconf, ASearchInTheBackgroundReportsWhyItFailed) {
  BackgroundSearch search;
  const auto [servers, reason] = searched(search);
  EXPECT_TRUE(servers.empty());
  EXPECT_NE(reason.find("apt install avahi-daemon"), std::string::npos) << reason;
}

TEST_F(Zeroconf, ASearchCanBeStopped) {
  ScriptedAvahi avahi;
  avahi.neverFinish();
  base::SimulatedClock stillStanding;  // the search never runs out of patience
  const int stopFd = ::eventfd(0, EFD_CLOEXEC);
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ::eventfd_write(stopFd, 1);
  });
  EXPECT_TRUE(findServers(stillStanding, base::toNanos(3600), stopFd).empty());
  stopper.join();
  ::close(stopFd);
}

TEST(ZeroconfWithoutABus, ServesOnAndSaysSo) {
  ::setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nowhere/bus", 1);
  { const Announcer announcer(lab(), net::kAnyAddress); }
  base::MonotonicClock clock;
  EXPECT_THROW(findServers(clock, base::toNanos(1)), std::runtime_error);
  ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
}

}  // namespace
}  // namespace hapticd::zeroconf

// What goes wrong with a device in contact, in the whole server: the force is gone within the ticks that
// docs/safety.md promises, clients are told in words, and it comes back without a restart.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/wait.h>

#include <cstdio>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "device/haply/mock_service.h"
#include "device/whole_server/event_kernel.h"
#include "device/whole_server/in_contact.h"

namespace hapticd::whole_server {
namespace {

using testing::HasSubstr;

struct Case {
  const char* name;
  mock::Fault fault;
  int ticksWithForce;
  const char* words;
  bool reopens = false;
};
void PrintTo(const Case& fault, std::ostream* out) {
  *out << fault.name;
}
constexpr auto kName = [](const auto& instance) { return std::string(instance.param.name); };

class DeviceFault : public InContact, public testing::WithParamInterface<Case> {
 protected:
  void endsInNoForceAndHeals() {
    strike(GetParam().fault, GetParam().ticksWithForce);
    expectWords(GetParam().words);
    if (GetParam().reopens) expectWords("the device does not open");
    heal(GetParam().reopens);
    endInOrder();
  }
};

class OpenHapticsFault : public DeviceFault {};

TEST_P(OpenHapticsFault, EndsInNoForceAndHeals) {
  serve({"--device", "openhaptics", "--in-process"}, {"HAPTICD_HDAPI_LIB=" MOCK_HD});
  endsInNoForceAndHeals();
}

// The driver there holds the force by itself: no tick is lost on the way to the server.
TEST_P(OpenHapticsFault, EndsInNoForceAndHealsInAProcessOfItsOwn) {
  serve({"--device", "openhaptics", "--isolate"}, {"HAPTICD_HDAPI_LIB=" MOCK_HD});
  endsInNoForceAndHeals();
}

INSTANTIATE_TEST_SUITE_P(
    Fault, OpenHapticsFault,
    testing::Values(Case{"Unplugged", mock::kUnplugged, 1, "HD_COMM_ERROR", true},
                    Case{"WarmMotors", mock::kWarmMotors, 1, "too hot"},
                    Case{"HotMotors", mock::kHotMotors, 0, "too hot"},
                    Case{"ForceExceeded", mock::kForceExceeded, 1, "HD_EXCEEDED_MAX_FORCE"},
                    Case{"NotCalibrated", mock::kNotCalibrated, 100, "not calibrated: put the stylus"}),
    kName);

TEST_F(InContact, AStylusThatIsPutIntoItsInkwellIsCalibratedThere) {
  serve({"--device", "openhaptics", "--in-process"}, {"HAPTICD_HDAPI_LIB=" MOCK_HD});
  strike(mock::kNotCalibrated, 100);
  expectWords("not calibrated: put the stylus into the inkwell");
  visitor->forget();
  arm->docked = true;
  expectWords("gives no force: the stylus is in the inkwell");
  EXPECT_TRUE(arm.left().isZero());
  arm->docked = false;
  expectWords("the device works again");
  touch();
  endInOrder();
}

// The library tells an identical error only once in its process.
TEST_F(InContact, ASecondPullOfTheCableIsNoticedWithoutAnError) {
  serve({"--device", "openhaptics", "--in-process"}, {"HAPTICD_HDAPI_LIB=" MOCK_HD});
  strike(mock::kUnplugged, 1);
  expectWords("HD_COMM_ERROR");
  heal(true);
  visitor->forget();
  strike(mock::kUnplugged, 502);
  EXPECT_TRUE(visitor->until([&] {
    // After a stall there is no force, and nothing to notice.
    if (visitor->latched()) visitor->client().rearmForces();
    return visitor->heard("one and the same position");
  })) << visitor->texts();
  heal(true);
  endInOrder();
}

#ifndef HAPTICD_SANITIZED  // the program of sanitized builds only serves

// Of a command on the machine of the server in `work`: its status, and what it printed.
std::pair<int, std::string> commandOf(const WorkDirectory& work, const std::string& arguments) {
  const std::string environment = "XDG_RUNTIME_DIR=" + work.file("") + " ";
  std::string text;
  FILE* const output = popen((environment + HAPTICD + " " + arguments + " 2>&1").c_str(), "r");
  for (int c = std::fgetc(output); c != EOF; c = std::fgetc(output)) text += static_cast<char>(c);
  return {WEXITSTATUS(pclose(output)), text};
}

// A fault is the reason to stop, and no refusal.
TEST_F(InContact, TheStopCommandTellsAFaultFromARefusal) {
  serve({"--device", "openhaptics", "--in-process"}, {"HAPTICD_HDAPI_LIB=" MOCK_HD});
  const std::string device = "Phantom@" + server->address();
  strike(mock::kWarmMotors, 1);
  expectWords("too hot");
  auto [status, text] = commandOf(work, "stop " + device);
  EXPECT_EQ(status, 0) << text;
  EXPECT_THAT(text, HasSubstr("forces are off"));
  std::tie(status, text) = commandOf(work, "stop --rearm " + device);
  EXPECT_EQ(status, 0) << text;
  EXPECT_THAT(text, HasSubstr("too hot"));
  EXPECT_THAT(text, HasSubstr("forces come back once the device gives them"));
  heal(false);
  std::tie(status, text) = commandOf(work, "stop " + device);
  EXPECT_EQ(status, 0) << text;
  std::tie(status, text) = commandOf(work, "stop --rearm " + device);
  EXPECT_EQ(status, 0) << text;
  EXPECT_THAT(text, HasSubstr("forces ramp in"));
  touch();
  endInOrder();
}

#endif

class ForceDimensionFault : public DeviceFault {};

TEST_P(ForceDimensionFault, EndsInNoForceAndHeals) {
  serve({"--device", "forcedimension"}, {"HAPTICD_DHD_LIB=" MOCK_DRD});
  endsInNoForceAndHeals();
}

INSTANTIATE_TEST_SUITE_P(
    Fault, ForceDimensionFault,
    testing::Values(Case{"Unplugged", mock::kUnplugged, 20, "check power and cable", true},
                    Case{"ForceExceeded", mock::kForceExceeded, 0, "switched its amplifiers off"},
                    Case{"NotCalibrated", mock::kNotCalibrated, 10, "not calibrated: keep hands off"}),
    kName);

TEST_F(InContact, ReArmingCalibratesAnArmWhereTheServerHasConsent) {
  serve({"--device", "forcedimension", "--calibrate"}, {"HAPTICD_DHD_LIB=" MOCK_DRD});
  strike(mock::kNotCalibrated, 10);
  expectWords("not calibrated: keep hands off");
  visitor->forget();
  visitor->client().rearmForces();
  expectWords("the device works again");
  touch();
  endInOrder();
}

TEST_F(InContact, ReArmingMovesNoArmWithoutConsent) {
  serve({"--device", "forcedimension"}, {"HAPTICD_DHD_LIB=" MOCK_DRD});
  strike(mock::kNotCalibrated, 10);
  expectWords("not calibrated: keep hands off");
  visitor->client().rearmForces();
  const std::int64_t before = arm->ticks;
  EXPECT_TRUE(visitor->until([&] { return arm->ticks > before + 500; }));
  EXPECT_FALSE(visitor->heard("the device works again")) << visitor->texts();
  EXPECT_TRUE(arm.left().isZero());
  endInOrder();
}

class HaplyFault : public InContact {
 protected:
  HaplyFault() { service.follow(*arm); }
  void serve() { InContact::serve({"--device", "haply:127.0.0.1:" + service.port()}, {}); }

  device::MockService service;
};

TEST_F(HaplyFault, TheServicesStatusEndsTheForce) {
  serve();
  strike(mock::kNotCalibrated, 2);
  expectWords("not calibrated");
  heal(false);
}

TEST_F(HaplyFault, ADeviceThatIsNotReadyGetsNoForce) {
  serve();
  strike(mock::kForceExceeded, 2);
  expectWords("the service says that the device is not ready");
  heal(false);
}

TEST_F(HaplyFault, AServiceThatIsGoneFreesTheDeviceAndIsFoundAgain) {
  serve();
  service.refuse(true);
  service.hangUp();
  EXPECT_TRUE(eventually([&] { return arm.left().isZero(); }));
  expectWords("the device gives no force");
  service.refuse(false);
  heal(false);
}

TEST_F(HaplyFault, ASilentServiceGetsNoMoreForces) {
  serve();
  service.mute(true);
  const int messages = service.messages();
  EXPECT_TRUE(eventually([&] { return arm.left().isZero(); })) << "hung up, which frees the device";
  EXPECT_LE(service.messages() - messages, 2);
  expectWords("no answer within 20 ms");
  service.mute(false);
  heal(false);
}

class OpenHapticsIsolatedFault : public InContact {
 protected:
  void serve() { InContact::serve({"--device", "openhaptics", "--isolate"}, {"HAPTICD_HDAPI_LIB=" MOCK_HD}); }
};

TEST_F(OpenHapticsIsolatedFault, ACrashOfTheLibraryIsAFaultAndANewProcessBringsTheDeviceBack) {
  serve();
  const std::int64_t before = arm->ticks;
  arm->fault = mock::kLibraryCrashes;
  expectWords("the driver's process ended");
  EXPECT_TRUE(visitor->until([&] { return visitor->latched(); }));
  EXPECT_LE(arm->ticks, before + 2) << "nothing is written any more";
  heal(true);
  endInOrder();
}

TEST_F(OpenHapticsIsolatedFault, AHangOfTheLibraryIsAFaultAndANewProcessBringsTheDeviceBack) {
  serve();
  arm->fault = mock::kLibraryHangs;
  expectWords("posts no states");
  EXPECT_TRUE(visitor->until([&] { return visitor->latched(); }));
  expectWords("being reopened");
  heal(false);
  endInOrder();
}

TEST_F(OpenHapticsIsolatedFault, TheServerEndsWhileAHungDeviceIsReopened) {
  serve();
  arm->fault = mock::kLibraryHangs;
  expectWords("being reopened");
  server->signal(SIGTERM);
  EXPECT_EQ(server->end(), 0) << server->log();
}

TEST_F(OpenHapticsIsolatedFault, TheServerEndsWhileADeviceHangsInItsOpening) {
  serve();
  strike(mock::kUnplugged, 1);
  const int opened = arm->opened;
  arm->fault = mock::kOpeningHangs;
  EXPECT_TRUE(visitor->until([&] { return arm->opened > opened; })) << server->log();
  endInOrder();
}

TEST_F(OpenHapticsIsolatedFault, AnUnpluggedDeviceIsReopenedInANewProcessEachTime) {
  serve();
  strike(mock::kUnplugged, 1);
  expectWords("HD_COMM_ERROR");
  heal(true);
  // In a new process the library has told nothing yet.
  visitor->forget();
  strike(mock::kUnplugged, 1);
  expectWords("HD_COMM_ERROR");
  heal(true);
  endInOrder();
}

TEST_F(OpenHapticsIsolatedFault, ADeviceThatDoesNotOpenIsTriedUntilItDoes) {
  serve();
  strike(mock::kUnplugged, 1);  // a text would not do: that of a stall before reads the same
  arm->fault = mock::kDoesNotOpen;
  expectWords("the device does not open: no OpenHaptics device opens");
  heal(true);
  endInOrder();
}

TEST(InitFailure, EndsTheServerWithWords) {
  device::MockService service;
  service.withoutDevice(true);
  struct Start {
    std::vector<std::string> arguments;
    std::string words;
  };
  const std::vector<Start> starts{
      {{"--device", "openhaptics", "--in-process"},
       "no OpenHaptics device opens: the default device: HD_DEVICE_FAULT"},
      {{"--device", "openhaptics", "--isolate"},
       "no OpenHaptics device opens: the default device: HD_DEVICE"},
      {{"--device", "forcedimension"}, "Force Dimension device 0 does not open: mock error"},
      {{"--device", "haply:127.0.0.1:" + service.port()}, "the service knows no Inverse3"},
      {{"--device", "haply:127.0.0.1:1"}, "connecting to 127.0.0.1:1: Connection refused"},
      {{"--device", "evdev:/nowhere/event0"}, "/nowhere/event0: No such file or directory"},
      {{"--device", "replay", "--hand", "/nowhere/hand.csv"}, "/nowhere/hand.csv"}};
  for (const Start& start : starts) {
    const WorkDirectory work;
    const SharedArm arm(work.file("arm"));
    arm->fault = mock::kDoesNotOpen;
    ServerProcess server(
        work, start.arguments,
        {"HAPTICD_HDAPI_LIB=" MOCK_HD, "HAPTICD_DHD_LIB=" MOCK_DRD, "HAPTICD_MOCK_ARM=" + work.file("arm")});
    EXPECT_EQ(server.address(), "");
    EXPECT_THAT(server.log(), HasSubstr(start.words));
    EXPECT_TRUE(arm.left().isZero());
  }
}

TEST_F(InContact, AnUnpluggedJoystickIsFoundAgain) {
  scene.stiffness = 0.15F;
  device::FakeJoystick joystick;
  EventKernel kernel(work.file("event0"), joystick);
  serveJoystick();
  ASSERT_TRUE(pressJoystick(kernel, joystick)) << server->log();
  kernel.unplug();
  EXPECT_TRUE(joystick.isIdle()) << "the kernel ends them";
  expectWords("plug it in again");
  EXPECT_TRUE(visitor->until([&] { return visitor->latched(); }));
  expectWords("the device does not open");
  kernel.plugIn();
  expectWords("the device works again");
  EXPECT_TRUE(pressJoystick(kernel, joystick)) << server->log();
  EXPECT_GE(kernel.opened(), 2);
}

}  // namespace
}  // namespace hapticd::whole_server

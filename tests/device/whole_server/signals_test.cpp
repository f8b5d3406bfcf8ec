// The server is ended, crashes, or is killed in contact: what force each device is left with, as
// docs/safety.md tells.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>
#include <string>

#include "device/haply/mock_service.h"
#include "device/whole_server/event_kernel.h"
#include "device/whole_server/in_contact.h"

namespace hapticd::whole_server {
namespace {

struct End {
  const char* name;
  int signal;
  bool inOrder;
};
void PrintTo(const End& end, std::ostream* out) {
  *out << end.name;
}

class AfterTheServer : public InContact, public testing::WithParamInterface<End> {
 protected:
  AfterTheServer() {
    // The server inherits it. ThreadSanitizer's own handler of a crash may wait for ever for a lock that the
    // interrupted thread holds.
    const char* const options = std::getenv("TSAN_OPTIONS");
    setenv("TSAN_OPTIONS", ((options == nullptr ? "" : options) + std::string(":handle_segv=0")).c_str(), 1);
  }
  // The mock's tick at which the server was gone for certain.
  std::int64_t endServer() {
    server->signal(GetParam().signal);
    const int status = server->end();
    if (GetParam().inOrder) {
      EXPECT_EQ(status, 0) << server->log();
    } else {
      EXPECT_NE(status, 0);
      EXPECT_NE(status, -1) << "it did not end";
    }
    return arm->ticks;
  }
};

TEST_P(AfterTheServer, OpenHaptics) {
  serve({"--device", "openhaptics", "--in-process"}, {"HAPTICD_HDAPI_LIB=" MOCK_HD});
  endServer();
  EXPECT_EQ(arm->closed, GetParam().inOrder ? 1 : 0);
  // Nobody is left to take the last force back: that is the vendor's driver's then.
  EXPECT_EQ(arm.left().isZero(), GetParam().inOrder);
}

TEST_P(AfterTheServer, OpenHapticsInAProcessOfItsOwn) {
  serve({"--device", "openhaptics"}, {"HAPTICD_HDAPI_LIB=" MOCK_HD});  // the default
  const std::int64_t gone = endServer();
  EXPECT_TRUE(eventually([&] { return arm->closed == 1; })) << "closed in order";
  EXPECT_TRUE(arm.left().isZero());
  // A force lives for 3 ms: three ticks, and the one that had begun.
  for (std::int64_t tick = gone + 4; tick < arm->ticks; ++tick) EXPECT_TRUE(arm.force(tick).isZero());
}

TEST_P(AfterTheServer, ForceDimension) {
  serve({"--device", "forcedimension"}, {"HAPTICD_DHD_LIB=" MOCK_DRD});
  endServer();
  if (GetParam().inOrder) {
    EXPECT_TRUE(arm.left().isZero());
    EXPECT_EQ(arm->amplifiers, 0);
    EXPECT_EQ(arm->closed, 1);
  } else {
    // The last force, until the watchdog in the device cuts it.
    EXPECT_EQ(arm->amplifiers, 1);
    EXPECT_EQ(arm->watchdog_us, 20000);
  }
}

TEST_P(AfterTheServer, Haply) {
  device::MockService service;
  service.follow(*arm);
  serve({"--device", "haply:127.0.0.1:" + service.port()}, {});
  endServer();
  EXPECT_TRUE(eventually([&] { return arm.left().isZero(); }))
      << "the service frees the device with its socket";
}

TEST_P(AfterTheServer, Evdev) {
  scene.stiffness = 0.15F;
  device::FakeJoystick joystick;
  EventKernel kernel(work.file("event0"), joystick);
  serveJoystick();
  ASSERT_TRUE(pressJoystick(kernel, joystick)) << server->log();
  endServer();
  EXPECT_TRUE(eventually([&] { return joystick.isIdle(); })) << "the kernel ends the effects with their file";
}

class StoppedByItsTerminal : public InContact {
 protected:
  // SIGTSTP, until the kernel has stopped all of the server's threads.
  void stopServer() {
    server->signal(SIGTSTP);
    siginfo_t info{};
    ASSERT_EQ(waitid(P_PID, static_cast<id_t>(server->id()), &info, WSTOPPED | WNOWAIT), 0);
    ASSERT_EQ(info.si_code, CLD_STOPPED) << server->log();
  }
  void endServer() {
    server->signal(SIGCONT);
    server->signal(SIGTERM);
    server->end();
  }
};

// A thread of the driver sends the force; it is stopped, too, and must have sent the zero.
TEST_F(StoppedByItsTerminal, LeavesNoForceOnEvdev) {
  scene.stiffness = 0.15F;  // less than the joystick's full force
  device::FakeJoystick joystick;
  EventKernel kernel(work.file("event0"), joystick);
  serveJoystick();
  ASSERT_TRUE(pressJoystick(kernel, joystick)) << server->log();
  stopServer();
  EXPECT_TRUE(eventually([&] {
    const auto [x, z] = joystick.force();
    return std::abs(x) + std::abs(z) == 0;
  })) << "what the server sent before it was stopped arrives";
  endServer();
}

TEST_F(StoppedByItsTerminal, LeavesNoForceOnHaply) {
  device::MockService service;
  service.follow(*arm);
  serve({"--device", "haply:127.0.0.1:" + service.port()}, {});
  stopServer();
  EXPECT_TRUE(eventually([&] { return arm.left().isZero(); }));
  endServer();
}

// A vendor's library may wait for a person there, and a calibration may move the arm.
TEST(WhileADeviceOpens, ASignalEndsTheProcess) {
  for (const char* where : {"--isolate", "--in-process"}) {
    const WorkDirectory work;
    const SharedArm arm(work.file("arm"));
    arm->fault = mock::kOpeningHangs;
    ServerProcess server(work, {"--device", "openhaptics", where},
                         {"HAPTICD_HDAPI_LIB=" MOCK_HD, "HAPTICD_MOCK_ARM=" + work.file("arm")});
    EXPECT_TRUE(eventually([&] { return arm->opened == 1; })) << server.log();
    server.signal(SIGTERM);
    EXPECT_EQ(server.end(), 0) << server.log();
    arm->fault = mock::kHealthy;
  }
}

INSTANTIATE_TEST_SUITE_P(By, AfterTheServer,
                         testing::Values(End{"SIGTERM", SIGTERM, true}, End{"SIGSEGV", SIGSEGV, false},
                                         End{"SIGKILL", SIGKILL, false}),
                         [](const auto& instance) { return std::string(instance.param.name); });

}  // namespace
}  // namespace hapticd::whole_server

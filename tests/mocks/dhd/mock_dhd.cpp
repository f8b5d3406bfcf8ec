// A stand-in for libdrd.so and, without the drd functions, for libdhd.so: two simulated arms, of which the
// environment's block drives the first. Where a caller
// would do harm on a real one, this one says why and aborts.
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>

#include "mocks/arm_block.h"
#include "mocks/dhd/mock_dhd_control.h"

#define EXPORT extern "C" __attribute__((visibility("default")))

namespace {

struct Mock {
  std::mutex mutex;
  int devices = 1;
  std::string name = "omega.3";
  bool open = false;
  bool calibrated = true;
  int calibrations = 0;
  bool regulating = false;  // a thread of the library drives the motors
  double calibrationTime = 0;
  double position[3] = {};
  double velocity[3] = {};
  double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  int buttons = 0;
  bool hasGripper = false;
  double gripper = 0.3;
  bool gripperFails = false;
  int failReads = 0;
  int status[17] = {};
  double force[3] = {};
  double torque[3] = {0.1, 0.1, 0.1};  // of the program before
  double grip = 1;
  bool amplifiers = false;
  int gravity = -1;
  int timeGuard = -1;
  int watchdog = 0;
  double sinceCommand = 0;
  double maxForce = -1;
  bool plugged = true;
  hapticd::mock::Arm shared = {};
  int fault = hapticd::mock::kHealthy;
};

constexpr int kArms = 2;

Mock* arms() {
  static Mock* const all = [] {
    auto* made = new Mock[kArms];
    made[0].shared = hapticd::mock::Arm::ofEnvironment();
    return made;
  }();
  return all;
}

// The first one. Its mutex guards all.
Mock& mock() {
  return arms()[0];
}

std::atomic<bool> calibrating{false};

[[noreturn]] void crash(const char* why) {
  std::fprintf(stderr, "mock DHD: %s\n", why);
  std::abort();
}

using Lock = std::lock_guard<std::mutex>;

// Every call on a device passes here.
Mock& device(char id, bool endsCalibration = false) {
  if (calibrating && !endsCalibration) crash("a call in the middle of a calibration");
  if (id < 0 || id >= kArms || !arms()[static_cast<int>(id)].open) crash("a call without a device");
  return arms()[static_cast<int>(id)];
}

// An index counts the arms that are plugged in; -1: none has it.
int armOf(int index) {
  for (int arm = 0; arm < mock().devices && arm < kArms; ++arm) {
    if (arms()[arm].plugged && index-- == 0) return arm;
  }
  return -1;
}

constexpr double kSharedTick_s = 0.001;  // the loop of the test runs at 1 kHz

// The device's own clock: its watchdog, whatever the program does.
void elapse(Mock& m, double seconds) {
  m.sinceCommand += seconds;
  if (m.watchdog > 0 && m.sinceCommand > m.watchdog * 125e-6) m.amplifiers = false;
}

// A tick begins with the first reading; what the test in another process wants in it.
void obeyShared(Mock& m) {
  using namespace hapticd::mock;
  if (!m.shared) return;
  const double* place = m.shared.begin();
  if (m.hasGripper) m.gripper = m.shared->gripper_rad;
  // To the user, right, up.
  m.position[0] = place[2], m.position[1] = place[0], m.position[2] = place[1];
  const int fault = m.shared.fault();
  const bool begins = fault != m.fault;
  elapse(m, kSharedTick_s);
  m.failReads = fault == kUnplugged ? -1 : 0;
  if (begins) m.calibrated = fault != kNotCalibrated;
  if (begins && fault == kForceExceeded) m.amplifiers = false;
  if (m.fault == kForceExceeded && fault == kHealthy) m.amplifiers = true;  // somebody pressed its button
  if (fault == kLibraryCrashes) std::raise(SIGSEGV);
  while (m.shared.fault() == kLibraryHangs) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  m.fault = fault;
}

void tellShared(Mock& m, bool tickEnds) {
  if (!m.shared) return;
  const double on = m.amplifiers ? 1 : 0;
  const double force[3] = {on * m.force[1], on * m.force[2], on * m.force[0]};
  m.shared->amplifiers = m.amplifiers ? 1 : 0;
  m.shared->watchdog_us = 125 * m.watchdog;
  if (tickEnds) {
    m.shared.end(force, m.shared.place(), m.fault);
  } else {
    m.shared.leave(force);
  }
}

int reading(Mock& m) {
  if (!m.plugged) return -1;
  if (m.failReads == 0) return 0;
  if (m.failReads > 0) --m.failReads;
  return -1;
}

}  // namespace

EXPORT int dhdGetDeviceCount() {
  const Lock lock(mock().mutex);
  int count = mock().devices;
  for (int arm = 0; arm < mock().devices && arm < kArms; ++arm) count -= arms()[arm].plugged ? 0 : 1;
  return count;
}

EXPORT int dhdOpenID(char index) {
  const Lock lock(mock().mutex);
  const int arm = armOf(index);
  if (arm < 0) return -1;
  Mock& m = arms()[arm];
  if (m.open) return arm;  // as the vendor's, whoever has it
  if (!m.shared.canOpen()) return -1;
  if (m.shared) ++m.shared->opened;
  if (m.shared && m.shared->gripper_rad >= 0) m.name = "sigma.7", m.hasGripper = true;
  m.open = true;
  return arm;
}

EXPORT int dhdClose(char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id);
  if (m.amplifiers) crash("closed with the amplifiers on");
  if (m.regulating) crash("closed in the middle of a regulation");
  if (m.shared) ++m.shared->closed;
  m.open = false;
  return 0;
}

EXPORT const char* dhdGetSystemName(char id) {
  const Lock lock(mock().mutex);
  return device(id).name.c_str();
}

EXPORT int dhdGetSerialNumber(unsigned short* out, char id) {
  const Lock lock(mock().mutex);
  device(id);
  *out = static_cast<unsigned short>(4711 + id);
  return 0;
}

EXPORT int dhdGetStatus(int* out, char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id);
  std::memcpy(out, m.status, sizeof m.status);
  out[3] = m.calibrated ? 0 : 1;
  out[5] = m.amplifiers ? 1 : 0;
  return 0;
}

EXPORT int dhdGetPosition(double* x, double* y, double* z, char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id);
  obeyShared(m);
  *x = m.position[0], *y = m.position[1], *z = m.position[2];
  return reading(m);
}

EXPORT int dhdGetLinearVelocity(double* x, double* y, double* z, char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id);
  *x = m.velocity[0], *y = m.velocity[1], *z = m.velocity[2];
  return 1;  // within the time guard: not a failure
}

EXPORT int dhdGetOrientationFrame(double (*out)[3], char id) {
  const Lock lock(mock().mutex);
  std::memcpy(out, device(id).rotation, sizeof(Mock::rotation));
  return 0;
}

EXPORT int dhdGetButtonMask(char id) {
  const Lock lock(mock().mutex);
  return device(id).buttons;
}

EXPORT bool dhdHasGripper(char id) {
  const Lock lock(mock().mutex);
  return device(id).hasGripper;
}

EXPORT int dhdGetGripperAngleRad(double* out, char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id);
  if (!m.hasGripper) crash("the gripper of a device without one");
  if (m.gripperFails) return -1;
  *out = m.gripper;
  return 0;
}

EXPORT int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx, double ty,
                                               double tz, double grip, char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id);
  if (!std::isfinite(fx + fy + fz)) crash("a force that is not a number");
  if (tx != 0 || ty != 0 || tz != 0 || grip != 0) crash("a torque that nobody asked for");
  if (!m.calibrated && !m.shared && (fx != 0 || fy != 0 || fz != 0)) crash("a force without calibration");
  const bool arrives = m.plugged && m.fault != hapticd::mock::kUnplugged;
  if (arrives) {
    m.force[0] = fx, m.force[1] = fy, m.force[2] = fz;
    m.torque[0] = tx, m.torque[1] = ty, m.torque[2] = tz;
    m.grip = grip;
    m.sinceCommand = 0;
  }
  tellShared(m, true);
  return arrives ? 0 : -1;
}

EXPORT int dhdEnableForce(unsigned char on, char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id, on == 0);
  if (on != 0 && m.gravity < 0) crash("amplifiers on before gravity compensation was chosen");
  m.amplifiers = on != 0;
  m.sinceCommand = 0;
  tellShared(m, false);
  return 0;
}

EXPORT int dhdSetGravityCompensation(int on, char id) {
  const Lock lock(mock().mutex);
  device(id).gravity = on;
  return 0;
}

EXPORT int dhdSetEffectorMass(double kg, char id) {
  const Lock lock(mock().mutex);
  device(id);
  return kg > 1 ? -1 : 0;
}

EXPORT int dhdSetMaxForce(double newtons, char id) {
  const Lock lock(mock().mutex);
  device(id).maxForce = newtons;
  return 0;
}

EXPORT int dhdSetTimeGuard(int microseconds, char id) {
  const Lock lock(mock().mutex);
  device(id).timeGuard = microseconds;
  return 0;
}

EXPORT int dhdSetWatchdog(unsigned char steps, char id) {
  const Lock lock(mock().mutex);
  device(id).watchdog = steps;
  return 0;
}

EXPORT int dhdStop(char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id);
  m.amplifiers = false;
  tellShared(m, false);
  return 0;
}

EXPORT const char* dhdErrorGetLastStr() {
  return "mock error";
}

#ifndef MOCK_WITHOUT_DRD

EXPORT int drdOpenID(char index) {
  return dhdOpenID(index);
}

EXPORT int drdClose(char id) {
  return dhdClose(id);
}

EXPORT bool drdIsInitialized(char id) {
  const Lock lock(mock().mutex);
  return device(id).calibrated;
}

EXPORT int drdAutoInit(char id) {
  double seconds = 0;
  {
    const Lock lock(mock().mutex);
    Mock& m = device(id);
    ++m.calibrations;
    seconds = m.calibrationTime;
    m.amplifiers = m.regulating = true;
    calibrating = true;
  }
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  const auto goesOn = [] {
    const Lock lock(mock().mutex);
    return mock().regulating;
  };
  while (goesOn() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  const Lock lock(mock().mutex);
  calibrating = false;
  if (seconds < 0 || !mock().regulating) return -1;
  mock().calibrated = true;
  return 0;
}

EXPORT int drdStop(bool forceOn, char id) {
  const Lock lock(mock().mutex);
  Mock& m = device(id, true);
  m.regulating = false;
  m.amplifiers = forceOn;
  return 0;
}

#endif

namespace {

template <class Value>
Value get(Value (*of)(Mock&)) {
  const Lock lock(mock().mutex);
  return of(mock());
}

const MockDhd kControl = {
    [] {
      const Lock lock(mock().mutex);
      arms()[1].plugged = true;
      arms()[1].open = arms()[1].amplifiers = false;
      arms()[1].gravity = -1;
      for (double& f : arms()[1].force) f = 0;
      Mock& m = mock();
      m.devices = 1;
      m.name = "omega.3";
      m.plugged = true;
      m.open = m.amplifiers = m.hasGripper = false;
      m.calibrated = true;
      m.regulating = false;
      m.calibrations = m.buttons = m.failReads = m.watchdog = 0;
      m.calibrationTime = m.sinceCommand = 0;
      m.gravity = m.timeGuard = -1;
      m.maxForce = -1;
      m.gripper = 0.3;
      m.gripperFails = false;
      for (double& t : m.torque) t = 0.1;
      m.grip = 1;
      for (double* v : {m.position, m.velocity, m.force}) std::memset(v, 0, 3 * sizeof *v);
      std::memset(m.status, 0, sizeof m.status);
      for (int i = 0; i < 9; ++i) m.rotation[i] = i % 4 == 0 ? 1 : 0;
    },
    [](int count, const char* name) {
      const Lock lock(mock().mutex);
      mock().devices = count;
      mock().name = name;
    },
    [](int yes) {
      const Lock lock(mock().mutex);
      mock().calibrated = yes != 0;
    },
    [](const double* position, const double* velocity) {
      const Lock lock(mock().mutex);
      std::memcpy(mock().position, position, sizeof mock().position);
      std::memcpy(mock().velocity, velocity, sizeof mock().velocity);
    },
    [](const double* rowMajor) {
      const Lock lock(mock().mutex);
      std::memcpy(mock().rotation, rowMajor, sizeof mock().rotation);
    },
    [](int mask) {
      const Lock lock(mock().mutex);
      mock().buttons = mask;
    },
    [](int has, double angle) {
      const Lock lock(mock().mutex);
      mock().hasGripper = has != 0;
      mock().gripper = angle;
    },
    [](int yes) {
      const Lock lock(mock().mutex);
      mock().gripperFails = yes != 0;
    },
    [](int count) {
      const Lock lock(mock().mutex);
      mock().failReads = count;
    },
    [](int index, int value) {
      const Lock lock(mock().mutex);
      mock().status[index] = value;
    },
    [](double seconds) {
      const Lock lock(mock().mutex);
      elapse(mock(), seconds);
    },
    [](double seconds) {
      const Lock lock(mock().mutex);
      mock().calibrationTime = seconds;
    },
    [](double* out) {
      const Lock lock(mock().mutex);
      for (int i = 0; i < 3; ++i) out[i] = mock().amplifiers ? mock().force[i] : 0;
    },
    [](double* torque, double* grip) {
      const Lock lock(mock().mutex);
      for (int i = 0; i < 3; ++i) torque[i] = mock().torque[i];
      *grip = mock().grip;
    },
    [] { return get<int>([](Mock& m) { return m.amplifiers ? 1 : 0; }); },
    [] { return get<int>([](Mock& m) { return m.open ? 1 : 0; }); },
    [] { return get<int>([](Mock& m) { return m.calibrations; }); },
    [] { return get<int>([](Mock& m) { return m.gravity; }); },
    [] { return get<int>([](Mock& m) { return m.timeGuard; }); },
    [] { return get<int>([](Mock& m) { return m.watchdog; }); },
    [] { return get<double>([](Mock& m) { return m.maxForce; }); },
    [] { return get<int>([](Mock& m) { return m.regulating ? 1 : 0; }); },
    [](int arm, int yes) {
      const Lock lock(mock().mutex);
      arms()[arm].plugged = yes != 0;
    },
    [](int arm, double* out) {
      const Lock lock(mock().mutex);
      const Mock& m = arms()[arm];
      for (int i = 0; i < 3; ++i) out[i] = m.amplifiers ? m.force[i] : 0;
    },
    [](int arm) {
      const Lock lock(mock().mutex);
      return arms()[arm].open ? 1 : 0;
    },
};

}  // namespace

EXPORT const MockDhd* mockDhd() {
  return &kControl;
}

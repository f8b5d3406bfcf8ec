// A stand-in for libHD.so: two simulated arms, a scheduler thread at 1 kHz, faults on demand. Where the
// vendor's library would crash or do something undefined, this one says why and aborts.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "mocks/arm_block.h"
#include "mocks/hd/mock_hd_control.h"

#define EXPORT extern "C" __attribute__((visibility("default")))

namespace {

struct ErrorInfo {
  unsigned code;
  int internalCode;
  unsigned device;
};

struct Arm {
  bool open = false;
  bool enabled = false;
  bool inScheduler = false;  // opened before the scheduler was started
  bool unplugged = false;
  double position[3] = {};
  double velocity[3] = {};
  double noise = 0;  // mm; nothing that lives holds still
  double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  int buttons = 0;
  unsigned char inkwell = 1;
  unsigned char safety = 1;
  double temperature = 0;
  unsigned calibration = 0x5000;

  int depth = 0;
  bool framed = false;  // one frame in each tick
  bool forceSet = false;
  double torque[3] = {10, 10, 10};  // of the program before
  double wanted[3] = {};
  double given[3] = {};
  int frames = 0;
  int updates = 0;
};

struct Callback {
  unsigned long id;
  unsigned (*function)(void*);
  void* data;
  unsigned short priority;
};

struct Mock {
  std::recursive_mutex mutex;
  Arm arms[2];
  std::string onlyName = "*";
  std::string model = "Touch";
  int style = 4;
  int outputDof = 3;
  bool banner = false;
  bool stepped = false;
  bool running = false;
  std::thread thread;
  std::atomic<bool> leave{false};
  std::thread::id scheduler;
  int current = -1;
  std::deque<ErrorInfo> errors;
  std::set<std::pair<unsigned, unsigned>> said;
  std::vector<Callback> callbacks;
  unsigned long nextId = 1;
  unsigned long rate = 1000;
  hapticd::mock::Arm shared = hapticd::mock::Arm::ofEnvironment();
  int fault = hapticd::mock::kHealthy;  // of the tick before
};

Mock& mock() {
  static Mock* one = new Mock;  // outlives the scheduler of a process that ends in the middle
  return *one;
}

using Lock = std::lock_guard<std::recursive_mutex>;

[[noreturn]] void crash(const char* why) {
  std::fprintf(stderr, "mock HD: %s\n", why);
  std::abort();
}

// An error that repeats one already told is not told again.
void push(unsigned code, unsigned device) {
  Mock& m = mock();
  if (!m.said.insert({code, device}).second) return;
  m.errors.push_front({code, -7, device});
}

Arm& currentArm(const char* call) {
  Mock& m = mock();
  if (m.current < 0 || !m.arms[m.current].open) crash(call);
  if (m.running && std::this_thread::get_id() != m.scheduler)
    crash("state is touched outside of the scheduler");
  return m.arms[m.current];
}

double norm(const double* v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

bool givesForce(const Arm& arm) {
  return arm.open && arm.enabled && arm.inScheduler && mock().running;
}

// What the test in another process wants of the first arm in this tick.
void obeyShared(Mock& m) {
  using namespace hapticd::mock;
  if (!m.shared) return;
  Arm& arm = m.arms[0];
  const double* place = m.shared.begin();
  const int fault = m.shared.fault();
  for (int i = 0; i < 3 && fault != kUnplugged; ++i) arm.position[i] = 1000 * place[i];
  const bool begins = fault != m.fault;
  if (begins && fault == kNotCalibrated) arm.calibration = 0x5002;
  if (begins && m.fault == kNotCalibrated) arm.calibration = 0x5000;  // by the vendor's tool
  arm.inkwell = m.shared->docked ? 0 : 1;
  if (m.shared->docked && arm.calibration == 0x5002) arm.calibration = 0x5001;
  m.fault = fault;
  arm.unplugged = fault == kUnplugged;
  arm.temperature = fault == kHotMotors ? 0.97 : 0.2;
  if (begins && fault == kWarmMotors) push(0x200, 0);
  if (begins && fault == kForceExceeded) push(0x201, 0);
  if (fault == kLibraryCrashes) std::raise(SIGSEGV);
  while (m.shared.fault() == kLibraryHangs) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

void tellShared(Mock& m) {
  if (!m.shared) return;
  constexpr double kNothing[3] = {};
  m.shared.end(givesForce(m.arms[0]) ? m.arms[0].given : kNothing, m.shared.place(), m.fault);
}

void tick() {
  Mock& m = mock();
  const Lock lock(m.mutex);
  m.scheduler = std::this_thread::get_id();
  for (Arm& arm : m.arms) arm.framed = false;
  obeyShared(m);
  for (Arm& arm : m.arms) {
    if (!arm.unplugged) arm.noise = 1e-12 - arm.noise;
  }
  const std::vector<Callback> now = m.callbacks;
  for (const Callback& callback : now) {
    if (callback.function(callback.data) == 0) crash("a frame callback ended itself");
  }
  for (const Arm& arm : m.arms) {
    if (arm.depth != 0) crash("a frame is open at the end of a tick");
  }
  tellShared(m);
  m.scheduler = {};
}

void run() {
  if (mock().shared) hapticd::mock::askForRealtime();
  auto next = std::chrono::steady_clock::now();
  while (!mock().leave) {
    tick();
    // Late ticks are not made up for.
    next =
        std::max(next + std::chrono::microseconds(1000000 / mock().rate), std::chrono::steady_clock::now());
    std::this_thread::sleep_until(next);
  }
}

bool isCurrentState(unsigned what) {
  return what >= 0x2000 && what < 0x2200;
}

void needFrame(const Arm& arm, unsigned what) {
  if (isCurrentState(what) && arm.depth == 0) crash("state is read outside of a frame");
}

}  // namespace

EXPORT unsigned hdInitDevice(const char* name) {
  Mock& m = mock();
  const Lock lock(m.mutex);
  if (m.running) crash("a device is opened while the scheduler runs");
  if (m.banner) {
    std::puts("mock HD banner: press a key");
    std::fflush(stdout);
    char key;
    if (read(STDIN_FILENO, &key, 1) > 0) crash("took a key from the program's stdin");
  }
  const std::string asked = name == nullptr ? "" : name;
  if ((m.onlyName != "*" && m.onlyName != asked) || !m.shared.canOpen()) {
    push(0x300, 0xFFFFFFFF);
    return 0xFFFFFFFF;
  }
  const int device = asked == "second" ? 1 : 0;
  m.arms[device].open = true;
  if (m.shared) ++m.shared->opened;
  while (m.shared.fault() == hapticd::mock::kOpeningHangs)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  m.current = device;
  return static_cast<unsigned>(device);
}

EXPORT void hdDisableDevice(unsigned device) {
  Mock& m = mock();
  const Lock lock(m.mutex);
  if (device > 1 || !m.arms[device].open) crash("hdDisableDevice without a device");
  if (m.running) crash("a device is closed while the scheduler runs");
  m.arms[device].open = m.arms[device].enabled = m.arms[device].inScheduler = false;
  if (m.current == static_cast<int>(device)) m.current = -1;
  if (m.shared) ++m.shared->closed;
}

EXPORT void hdMakeCurrentDevice(unsigned device) {
  Mock& m = mock();
  const Lock lock(m.mutex);
  if (device > 1 || !m.arms[device].open) crash("hdMakeCurrentDevice without a device");
  m.current = static_cast<int>(device);
}

EXPORT unsigned hdGetCurrentDevice() {
  const Lock lock(mock().mutex);
  return mock().current < 0 ? 0xFFFFFFFF : static_cast<unsigned>(mock().current);
}

EXPORT void hdBeginFrame(unsigned device) {
  Mock& m = mock();
  const Lock lock(m.mutex);
  if (device > 1 || !m.arms[device].open) crash("hdBeginFrame without a device");
  Arm& arm = m.arms[device];
  if (m.running && std::this_thread::get_id() != m.scheduler) crash("a frame outside of the scheduler");
  if (arm.depth == 0 && arm.framed) push(0x400, device);
  if (arm.depth++ > 0) return;
  arm.framed = true;
  arm.forceSet = false;
  std::memset(arm.wanted, 0, sizeof arm.wanted);
}

EXPORT void hdEndFrame(unsigned device) {
  Mock& m = mock();
  const Lock lock(m.mutex);
  if (device > 1 || !m.arms[device].open) crash("hdEndFrame without a device");
  Arm& arm = m.arms[device];
  if (arm.depth == 0) crash("hdEndFrame without hdBeginFrame");
  if (--arm.depth > 0) return;
  if (!arm.forceSet) crash("a frame without a force");
  ++arm.frames;
  const double change[3] = {arm.wanted[0] - arm.given[0], arm.wanted[1] - arm.given[1],
                            arm.wanted[2] - arm.given[2]};
  if (norm(arm.wanted) > 3.3 * (1 + 1e-9)) push(0x201, device);
  if (norm(arm.wanted) > norm(arm.given) && norm(change) > 4) push(0x202, device);
  if (norm(arm.velocity) > 1200 && norm(arm.wanted) > 0) push(0x203, device);
  if (arm.unplugged) push(0x302, device);
  std::memcpy(arm.given, arm.wanted, sizeof arm.given);
}

EXPORT void hdEnable(unsigned what) {
  const Lock lock(mock().mutex);
  Arm& arm = currentArm("hdEnable without a device");
  if (what == 0x4000) arm.enabled = true;
}

EXPORT void hdDisable(unsigned what) {
  const Lock lock(mock().mutex);
  Arm& arm = currentArm("hdDisable without a device");
  if (what == 0x4000) arm.enabled = false;
}

EXPORT unsigned char hdIsEnabled(unsigned what) {
  const Lock lock(mock().mutex);
  return what == 0x4000 && currentArm("hdIsEnabled without a device").enabled ? 1 : 0;
}

EXPORT void hdGetBooleanv(unsigned what, unsigned char* out) {
  const Lock lock(mock().mutex);
  const Arm& arm = currentArm("hdGetBooleanv without a device");
  needFrame(arm, what);
  if (what == 0x2001) *out = arm.safety;
  if (what == 0x2002) *out = arm.inkwell;
}

EXPORT void hdGetIntegerv(unsigned what, int* out) {
  const Lock lock(mock().mutex);
  const Arm& arm = currentArm("hdGetIntegerv without a device");
  needFrame(arm, what);
  if (what == 0x2000) *out = arm.buttons;
  if (what == 0x2553) *out = 6;
  if (what == 0x2554) *out = mock().outputDof;
  if (what == 0x2555) *out = mock().style;
}

EXPORT void hdGetDoublev(unsigned what, double* out) {
  const Lock lock(mock().mutex);
  const Arm& arm = currentArm("hdGetDoublev without a device");
  needFrame(arm, what);
  static constexpr double kWorkspace[6] = {-80, -60, -35, 80, 60, 35};
  switch (what) {
    case 0x2050:
      std::memcpy(out, arm.position, sizeof arm.position);
      out[2] += arm.noise;
      break;
    case 0x2051:
      std::memcpy(out, arm.velocity, sizeof arm.velocity);
      break;
    case 0x2052:
      for (int column = 0; column < 4; ++column) {
        for (int row = 0; row < 4; ++row) {
          double value = row == column ? 1 : 0;
          if (row < 3 && column < 3) value = arm.rotation[3 * column + row];
          if (row < 3 && column == 3) value = arm.position[row];
          out[4 * column + row] = value;
        }
      }
      break;
    case 0x2053:
      out[0] = 0.1, out[1] = 0.2, out[2] = 0.3;
      break;
    case 0x2551:
      std::memcpy(out, kWorkspace, sizeof kWorkspace);
      break;
    case 0x2602:
      out[0] = 0.5;
      break;
    case 0x2603:
      out[0] = 3.3;
      break;
    case 0x2604:
      out[0] = 0.88;
      break;
    case 0x2605:
      for (int i = 0; i < 3; ++i) out[i] = i == 1 ? arm.temperature : 0;
      break;
    case 0x2606:
      out[0] = 1200;
      break;
    case 0x2607:
      out[0] = 4;
      break;
    case 0x2700:
      std::memcpy(out, arm.wanted, sizeof arm.wanted);
      break;
    default:
      push(0x100, static_cast<unsigned>(mock().current));
      break;
  }
}

EXPORT void hdSetDoublev(unsigned what, const double* in) {
  const Lock lock(mock().mutex);
  Arm& arm = currentArm("hdSetDoublev without a device");
  if (what != 0x2700 && what != 0x2704) return;
  if (arm.depth == 0) crash("a force outside of a frame");
  if (what == 0x2704) {
    if (mock().outputDof < 6) crash("a torque for a device without motors for it");
    std::memcpy(arm.torque, in, sizeof arm.torque);
    return;
  }
  if (arm.forceSet) crash("the force is set twice in a frame");
  if (!std::isfinite(in[0] + in[1] + in[2])) crash("a force that is not a number");
  arm.forceSet = true;
  std::memcpy(arm.wanted, in, sizeof arm.wanted);
}

EXPORT const char* hdGetString(unsigned what) {
  const Lock lock(mock().mutex);
  currentArm("hdGetString without a device");
  switch (what) {
    case 0x2501:
      return mock().model.c_str();
    case 0x2502:
      return "mock 1";
    case 0x2504:
      return "MOCK-0001";
    default:
      return nullptr;
  }
}

EXPORT ErrorInfo hdGetError() {
  Mock& m = mock();
  const Lock lock(m.mutex);
  if (m.errors.empty()) return {0, 0, 0xFFFFFFFF};
  const ErrorInfo newest = m.errors.front();
  m.errors.pop_front();
  return newest;
}

EXPORT unsigned hdCheckCalibration() {
  const Lock lock(mock().mutex);
  return currentArm("hdCheckCalibration without a device").calibration;
}

EXPORT void hdUpdateCalibration(unsigned style) {
  const Lock lock(mock().mutex);
  Arm& arm = currentArm("hdUpdateCalibration without a device");
  if (norm(arm.given) > 0) crash("the calibration is updated under force");
  if ((static_cast<int>(style) & mock().style) == 0)
    crash("a calibration style that the device does not have");
  if (style == 4 && arm.inkwell != 0) crash("an inkwell calibration with the stylus elsewhere");
  arm.calibration = 0x5000;
  ++arm.updates;
}

EXPORT void hdSetSchedulerRate(unsigned long rate) {
  const Lock lock(mock().mutex);
  if (rate != 500 && rate != 1000 && rate != 1600) {
    push(0x101, 0);
    return;
  }
  mock().rate = rate;
}

EXPORT unsigned long hdScheduleAsynchronous(unsigned (*function)(void*), void* data,
                                            unsigned short priority) {
  Mock& m = mock();
  const Lock lock(m.mutex);
  m.callbacks.push_back({m.nextId, function, data, priority});
  return m.nextId++;
}

EXPORT void hdUnschedule(unsigned long id) {
  Mock& m = mock();
  const Lock lock(m.mutex);
  if (m.running) crash("hdUnschedule while the scheduler runs");
  for (auto it = m.callbacks.begin(); it != m.callbacks.end(); ++it) {
    if (it->id != id) continue;
    m.callbacks.erase(it);
    return;
  }
  crash("hdUnschedule of nothing");
}

EXPORT void hdStartScheduler() {
  Mock& m = mock();
  const Lock lock(m.mutex);
  if (m.running) crash("the scheduler is started twice");
  m.running = true;
  m.leave = false;
  for (Arm& arm : m.arms) arm.inScheduler = arm.open;
  if (!m.stepped) m.thread = std::thread(run);
}

EXPORT void hdStopScheduler() {
  Mock& m = mock();
  {
    const Lock lock(m.mutex);
    if (std::this_thread::get_id() == m.scheduler) crash("the scheduler stops itself");
  }
  m.leave = true;
  if (m.thread.joinable()) m.thread.join();
  const Lock lock(m.mutex);
  m.running = false;
  m.shared.switchOff();  // the amplifiers go with the scheduler
}

// The control side.
namespace {

void controlReset() {
  Mock& m = mock();
  if (m.running) hdStopScheduler();
  const Lock lock(m.mutex);
  for (Arm& arm : m.arms) arm = Arm();
  m.onlyName = "*";
  m.model = "Touch";
  m.style = 4;
  m.outputDof = 3;
  m.banner = m.stepped = false;
  m.current = -1;
  m.errors.clear();
  m.said.clear();
  m.callbacks.clear();
  m.rate = 1000;
}

void controlStep(int ticks) {
  for (int i = 0; i < ticks && mock().running; ++i) tick();
}

template <class Work>
void with(int device, Work&& work) {
  const Lock lock(mock().mutex);
  work(mock().arms[device]);
}

const MockHd kControl = {
    &controlReset,
    [](int on) { mock().stepped = on != 0; },
    &controlStep,
    [](const char* name) { mock().onlyName = name == nullptr ? "" : name; },
    [](const char* name, int style) {
      mock().model = name;
      mock().style = style;
    },
    [](int axes) { mock().outputDof = axes; },
    [](int on) { mock().banner = on != 0; },
    [](int device, const double* position, const double* velocity) {
      with(device, [&](Arm& arm) {
        std::memcpy(arm.position, position, sizeof arm.position);
        std::memcpy(arm.velocity, velocity, sizeof arm.velocity);
      });
    },
    [](int device, const double* rotation) {
      with(device, [&](Arm& arm) { std::memcpy(arm.rotation, rotation, sizeof arm.rotation); });
    },
    [](int device, int bits) { with(device, [&](Arm& arm) { arm.buttons = bits; }); },
    [](int device, int value) {
      with(device, [&](Arm& arm) { arm.inkwell = static_cast<unsigned char>(value); });
    },
    [](int device, int value) {
      with(device, [&](Arm& arm) { arm.safety = static_cast<unsigned char>(value); });
    },
    [](int device, double value) { with(device, [&](Arm& arm) { arm.temperature = value; }); },
    [](int device, unsigned status) { with(device, [&](Arm& arm) { arm.calibration = status; }); },
    [](int device, unsigned code) { with(device, [&](Arm&) { push(code, static_cast<unsigned>(device)); }); },
    [](int device) { with(device, [&](Arm& arm) { arm.unplugged = true; }); },
    [](int device) { with(device, [&](Arm& arm) { arm.unplugged = false; }); },
    [](int device, double* out) {
      with(device, [&](Arm& arm) {
        const bool on = givesForce(arm);
        for (int i = 0; i < 3; ++i) out[i] = on ? arm.given[i] : 0;
      });
    },
    [](int device, double* out) {
      with(device, [&](Arm& arm) { std::memcpy(out, arm.torque, sizeof arm.torque); });
    },
    [](int device) {
      int value = 0;
      with(device, [&](Arm& arm) { value = arm.frames; });
      return value;
    },
    [](int device) {
      int value = 0;
      with(device, [&](Arm& arm) { value = arm.updates; });
      return value;
    },
    [](int device) {
      int value = 0;
      with(device, [&](Arm& arm) { value = arm.open ? 1 : 0; });
      return value;
    },
    []() {
      const Lock lock(mock().mutex);
      return mock().running ? 1 : 0;
    },
    []() {
      const Lock lock(mock().mutex);
      return mock().callbacks.empty() ? static_cast<unsigned short>(0) : mock().callbacks.front().priority;
    },
};

}  // namespace

EXPORT const MockHd* mockHd() {
  return &kControl;
}

// The driver on the mock of libHD, found as the vendor's library would be.
#pragma once

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <functional>
#include <thread>

#include "device/openhaptics/openhaptics_device.h"
#include "mocks/hd/mock_hd_control.h"

namespace hapticd::device {

class HdTest : public testing::Test {
 protected:
  void SetUp() override {
    setenv("HAPTICD_HDAPI_LIB", MOCK_HD, 1);
    void* library = dlopen(MOCK_HD, RTLD_NOW);
    ASSERT_NE(library, nullptr) << dlerror();
    mock = reinterpret_cast<const MockHd* (*)()>(dlsym(library, "mockHd"))();
    mock->reset();
  }

  void hand(const Vec3& position_m, const Vec3& velocity_m_per_s = Vec3::Zero(), int device = 0) const {
    const Vec3 p = 1000 * position_m;
    const Vec3 v = 1000 * velocity_m_per_s;
    mock->hand(device, p.data(), v.data());
  }
  Vec3 force(int device = 0) const {
    Vec3 f;
    mock->force(device, f.data());
    return f;
  }

  const MockHd* mock = nullptr;
};

/// The scheduler ticks when told; the server's tick pushes with one force.
class SteppedHdTest : public HdTest {
 protected:
  void SetUp() override {
    HdTest::SetUp();
    mock->stepped(1);
  }
  void start() {
    device.open();
    device.start([this](Nanos now) {
      stateRead = device.read(now, state);
      taken = device.write(wanted_N);
    });
  }
  void step(int ticks = 1) const { mock->step(ticks); }

  OpenHapticsDevice device;
  DeviceState state;
  bool stateRead = false;
  bool taken = false;  // the last force
  Vec3 wanted_N = Vec3::Zero();
};

/// Waits, for at most 5 s, for something that another thread does.
inline bool eventually(const std::function<bool()>& condition) {
  for (int i = 0; i < 5000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

}  // namespace hapticd::device

// Scripted device and clock for tests of the servo.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "base/clock.h"
#include "device/device.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using base::Nanos;
using geometry::Vec3;

/// Delivers the state that the test sets and keeps the last force written.
class FakeDevice final : public device::Device {
 public:
  FakeDevice() { profile_.startsArmed = true; }
  void open() override {}
  void close() noexcept override {}
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(base::Nanos now, device::DeviceState& out) noexcept override {
    ++reads;
    if (onRead) onRead();
    if (!gives) return false;
    out = state;
    out.time = now;
    return true;
  }
  bool write(const Vec3& force_N) noexcept override {
    ++writes;
    written_N = force_N;
    if (onWrite != nullptr) onWrite(context);
    return takes;
  }
  bool zeroFromOtherThread() noexcept override {
    ++zeroes;
    written_N.setZero();
    return true;
  }

  bool zeroSent() const noexcept override { return sends; }

  std::function<void()> onRead;
  bool sends = true;
  int zeroes = 0;
  device::DeviceState state;
  bool gives = true;
  bool takes = true;
  int reads = 0;
  int writes = 0;
  Vec3 written_N = Vec3::Constant(-1);
  void (*onWrite)(void*) = nullptr;
  void* context = nullptr;

 private:
  device::DeviceProfile profile_;
};

/// Oversleeps as scripted, then not at all.
class FakeClock final : public base::Clock {
 public:
  Nanos now() noexcept override { return now_; }
  void sleepUntil(Nanos deadline) noexcept override {
    const Nanos late = sleeps_ < oversleeps.size() ? oversleeps[sleeps_] : 0;
    ++sleeps_;
    if (deadline > now_) now_ = deadline;
    now_ += late;
  }
  Nanos wallNow() noexcept override { return now_; }
  void advance(Nanos by) noexcept { now_ += by; }

  std::vector<Nanos> oversleeps;

 private:
  Nanos now_ = 1'000'000'000;
  std::size_t sleeps_ = 0;
};

/// A scene with one constant force and nothing to touch.
inline std::shared_ptr<const scene::SceneSnapshot> constantForce(std::uint64_t revision,
                                                                 const Vec3& force_N) {
  auto snapshot = std::make_shared<scene::SceneSnapshot>();
  snapshot->revision = revision;
  scene::Effect effect;
  effect.type = scene::EffectType::constant;
  effect.magnitude_N = force_N.norm();
  effect.direction = force_N;
  snapshot->effects.push_back(effect);
  return snapshot;
}

}  // namespace hapticd::realtime

// The six force effects of the scene, each with its own start time. docs/haptics.md states the laws.
#pragma once

#include <array>

#include "realtime/render/renderer.h"

namespace hapticd::realtime {

/// Start times and anchors of the running effects. Servo thread: noexcept, no allocation.
class Effects {
 public:
  /// Sum of the forces of all running effects at `now`, device frame, newtons. `contact` holds the proxy and
  /// the surface normal of this tick.
  Vec3 force(const scene::SceneSnapshot& scene, const device::DeviceState& device, const Rendering& contact,
             Nanos now) noexcept;

  void reset() noexcept { count_ = 0; }

 private:
  static constexpr int kMaxEffects = 64;

  struct Running {
    std::int32_t index = 0;
    std::uint32_t start = 0;
    Nanos begin = 0;
    Nanos releaseBegin = -1;  ///< -1: not releasing
    Vec3 anchor = Vec3::Zero();
    bool seen = false;
  };

  static Vec3 forceOf(const scene::Effect& effect, Running& r, const Affine& T_device_world,
                      const device::DeviceState& device, const Rendering& contact, Nanos now) noexcept;
  Running* running(const scene::Effect& effect, Nanos now, const Vec3& proxy) noexcept;
  void forgetUnseen() noexcept;

  std::array<Running, kMaxEffects> running_;
  int count_ = 0;
};

}  // namespace hapticd::realtime

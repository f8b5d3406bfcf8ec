// The six force effects of the scene, each with its own start time. docs/haptics.md states the laws.
#pragma once

#include <array>

#include "realtime/render/memory.h"
#include "realtime/render/renderer.h"

namespace hapticd::realtime {

/// Start times, phases and anchors of the running effects. Servo thread: noexcept, no allocation.
class Effects {
 public:
  /// `contactVibrationPulls`: a contact vibration may exceed the normal force of the contact.
  explicit Effects(bool contactVibrationPulls) noexcept : contactVibrationPulls_(contactVibrationPulls) {}

  /// Sum of the forces of all running effects at `now`, device frame, newtons. `contact` holds the proxy and
  /// the surface normal of this tick, `pressed_N` is the force of surface and brake along the normal.
  Vec3 force(const scene::SceneSnapshot& scene, const device::DeviceState& device, const Rendering& contact,
             double pressed_N, Nanos now) noexcept;

  void reset() noexcept { count_ = 0; }
  /// The hand may be anywhere: what is anchored where it was is anchored at the next proxy.
  void restart() noexcept { anew_ = true; }
  /// False while one ramps out: its share is not part of the memory.
  bool remember(RenderMemory& out) const noexcept;
  /// Continues those of the running effects that the memory has; timed ones that it has not are over.
  void resume(const RenderMemory& memory) noexcept;

  /// The angle of a vibration whose frequency may change while it runs: the frequency over time, integrated.
  class Phase {
   public:
    /// At `now`, radians; `start` is the time of phase zero.
    double at(Nanos now, Nanos start, double angularFrequency_rad_per_s) noexcept;

    void remember(EffectMemory& out) const noexcept;
    void resume(const EffectMemory& memory) noexcept;

   private:
    double frequency_ = 0;  // rad/s, since since_
    double angle_ = 0;      // at since_
    Nanos since_ = -1;      // -1: not started
  };

 private:
  struct Running {
    std::int32_t index = 0;
    std::uint32_t start = 0;
    Nanos begin = 0;
    Nanos releaseBegin = -1;     ///< -1: not releasing
    Vec3 anchor = Vec3::Zero();  ///< of a friction effect, device frame
    bool seen = false;
    Phase phase;
    bool rubs = false;        ///< a friction effect, in the last tick
    double frictionGain = 0;  ///< of the last tick; 0: it did not rub, or nobody remembers
    double frictionLimit_N = 0;

    void changeFriction(double gain, double limit_N, const Vec3& proxy) noexcept;
    void anchorAt(const Vec3& proxy) noexcept {
      anchor = proxy;
      rubs = false;
      frictionGain = 0;
    }
  };

  static Vec3 forceOf(const scene::Effect& effect, Running& r, const Affine& T_device_world,
                      const device::DeviceState& device, const Rendering& contact, Nanos now) noexcept;
  Running* find(const scene::Effect& effect) noexcept;
  Running* running(const scene::Effect& effect, Nanos now, const Vec3& proxy) noexcept;
  void moveWithView(const scene::SceneSnapshot& scene, const Vec3& proxy) noexcept;
  void forgetUnseen() noexcept;

  bool contactVibrationPulls_;
  bool anew_ = false;
  Affine T_world_device_ = Affine::Identity();  // of the last tick
  std::array<Running, 2 * kMaxEffects + scene::kMostOfEarlierReset> running_;
  int count_ = 0;
};

}  // namespace hapticd::realtime

#include "realtime/render/effects.h"

#include <algorithm>
#include <cmath>

namespace hapticd::realtime {
namespace {

using scene::Effect;
using scene::EffectType;

constexpr Nanos kReleaseTime = geometry::toNanos(0.250);

Vec3 atMost(const Vec3& force, double limit) {
  const double size = force.norm();
  return size > limit ? Vec3(force * (limit / size)) : force;
}

Vec3 constantForce(const Effect& effect, const Affine& T_device_world) {
  const Vec3 direction = T_device_world.linear() * effect.direction;
  const double length = direction.norm();
  return length > 0 ? Vec3(direction * (effect.magnitude_N / length)) : Vec3(Vec3::Zero());
}

// Before it slips, the friction effect is a spring to its anchor; at its limit it drags the anchor along.
Vec3 frictionForce(const Effect& effect, const Vec3& proxy, Vec3& anchor) {
  const Vec3 pull = effect.gain * (anchor - proxy);
  const Vec3 force = atMost(pull, effect.magnitude_N);
  if (effect.gain > 0) anchor = proxy + force / effect.gain;
  return force;
}

}  // namespace

Effects::Running* Effects::running(const Effect& effect, Nanos now, const Vec3& proxy) noexcept {
  for (int i = 0; i < count_; ++i) {
    Running& r = running_[static_cast<std::size_t>(i)];
    if (r.index == effect.index && r.start == effect.start) return &r;
  }
  if (count_ == kMaxEffects) return nullptr;
  Running& fresh = running_[static_cast<std::size_t>(count_++)];
  fresh = {effect.index, effect.start, now, -1, proxy, true};
  return &fresh;
}

void Effects::forgetUnseen() noexcept {
  const auto last = running_.begin() + count_;
  const auto end = std::remove_if(running_.begin(), last, [](const Running& r) { return !r.seen; });
  count_ = static_cast<int>(end - running_.begin());
}

Vec3 Effects::force(const scene::SceneSnapshot& scene, const device::DeviceState& hand,
                    const Rendering& contact, Nanos now, bool motorInDeviceFrame) noexcept {
  for (int i = 0; i < count_; ++i) running_[static_cast<std::size_t>(i)].seen = false;
  const Affine& T_device_world = scene.workspace.T_device_world;
  Vec3 sum = Vec3::Zero();
  for (const Effect& effect : scene.effects) {
    Running* r = running(effect, now, contact.proxy_m);
    if (r == nullptr) continue;
    r->seen = true;
    if (effect.duration > 0 && now - r->begin >= effect.duration) continue;
    const double phase = effect.angularFrequency_rad_per_s * geometry::toSeconds(now - r->begin);
    Vec3 force = Vec3::Zero();
    switch (effect.type) {
      case EffectType::constant:
        force = constantForce(effect, T_device_world);
        break;
      case EffectType::spring:
        force =
            atMost(effect.gain * (T_device_world * effect.position - contact.proxy_m), effect.magnitude_N);
        break;
      case EffectType::viscous:
        force = atMost(-effect.gain * hand.velocity_m_per_s, effect.magnitude_N);
        break;
      case EffectType::friction:
        force = frictionForce(effect, contact.proxy_m, r->anchor);
        break;
      case EffectType::motorVibration:
        force = effect.magnitude_N * Vec3(std::cos(phase), std::sin(phase), 0);
        if (!motorInDeviceFrame) force = hand.orientation * force;
        break;
      case EffectType::contactVibration:
        if (contact.touching) force = effect.magnitude_N * std::sin(phase) * contact.normal;
        break;
    }
    if (effect.releasing && r->releaseBegin < 0) r->releaseBegin = now;
    if (r->releaseBegin >= 0) {
      const double left = 1 - static_cast<double>(now - r->releaseBegin) / static_cast<double>(kReleaseTime);
      force *= std::max(0.0, left);
    }
    sum += force;
  }
  forgetUnseen();
  return sum;
}

}  // namespace hapticd::realtime

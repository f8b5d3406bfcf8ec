#include "realtime/render/effects.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/time.h"
#include "realtime/render/release.h"
#include "realtime/render/view_motion.h"

namespace hapticd::realtime {
namespace {

using scene::Effect;
using scene::EffectType;

constexpr double kFarthestAnchor_m = 1e30;

Vec3 atMost(const Vec3& force, double limit) {
  const double size = force.norm();
  return size > limit ? Vec3(force * (limit / size)) : force;
}

// The friction effect is a spring to its anchor; at the force limit it drags the anchor along.
Vec3 frictionForce(double gain, double limit_N, const Vec3& proxy, Vec3& anchor) {
  const Vec3 force = atMost(gain * (anchor - proxy), limit_N);
  if (gain > 0) anchor = proxy + force / gain;
  return force;
}

}  // namespace

double Effects::Phase::at(Nanos now, Nanos start, double angularFrequency_rad_per_s) noexcept {
  if (since_ < 0) {
    since_ = start;
    frequency_ = angularFrequency_rad_per_s;
  }
  if (frequency_ != angularFrequency_rad_per_s) {
    angle_ = std::fmod(angle_ + frequency_ * base::toSeconds(now - since_), 2 * M_PI);
    since_ = now;
    frequency_ = angularFrequency_rad_per_s;
  }
  return angle_ + frequency_ * base::toSeconds(now - since_);
}

void Effects::Phase::remember(EffectMemory& out) const noexcept {
  out.frequency_rad_per_s = frequency_;
  out.angle_rad = angle_;
  out.since = since_;
}

void Effects::Phase::resume(const EffectMemory& memory) noexcept {
  frequency_ = memory.frequency_rad_per_s;
  angle_ = memory.angle_rad;
  since_ = memory.since;
}

bool Effects::remember(RenderMemory& out) const noexcept {
  // With more, some ramp out.
  out.effectCount = std::min(static_cast<std::uint32_t>(count_), static_cast<std::uint32_t>(kMaxEffects));
  for (std::size_t i = 0; i < out.effectCount; ++i) {
    const Running& r = running_[i];
    if (r.releaseBegin >= 0) return false;
    out.effects[i].index = r.index;
    out.effects[i].begin = r.begin;
    out.effects[i].anchor = r.anchor;
    r.phase.remember(out.effects[i]);
  }
  return count_ <= static_cast<int>(kMaxEffects);
}

// By the index: the numbers of the starts are those of this scene. One that the memory has not is over if it
// has a duration: recordings of older versions start it anew.
void Effects::resume(const RenderMemory& memory) noexcept {
  for (int i = 0; i < count_; ++i) {
    Running& r = running_[static_cast<std::size_t>(i)];
    const auto end = memory.effects.begin() + memory.effectCount;
    const auto known =
        std::find_if(memory.effects.begin(), end, [&](const EffectMemory& m) { return m.index == r.index; });
    if (known == end) {
      r.begin = std::numeric_limits<Nanos>::min() / 2;
      continue;
    }
    r.begin = known->begin;
    r.anchor = known->anchor;
    r.rubs = true;
    r.phase.resume(*known);
  }
}

// With the new gain the anchor exerts the force that it did. What begins to rub begins where the hand is.
void Effects::Running::changeFriction(double gain, double limit_N, const Vec3& proxy) noexcept {
  if (!rubs) anchor = proxy;
  if (gain != frictionGain && gain > 0 && frictionGain > 0)
    anchor = proxy + frictionForce(frictionGain, frictionLimit_N, proxy, anchor) / gain;
  // With hardly any gain, no anchor exerts the force.
  if (!(gain > 0) || !(anchor.cwiseAbs().maxCoeff() <= kFarthestAnchor_m)) return anchorAt(proxy);
  rubs = true;
  frictionGain = gain;
  frictionLimit_N = limit_N;
}

Effects::Running* Effects::find(const Effect& effect) noexcept {
  for (int i = 0; i < count_; ++i) {
    Running& r = running_[static_cast<std::size_t>(i)];
    if (r.index == effect.index && r.start == effect.start) return &r;
  }
  return nullptr;
}

Effects::Running* Effects::running(const Effect& effect, Nanos now, const Vec3& proxy) noexcept {
  if (Running* const known = find(effect)) return known;
  if (count_ == static_cast<int>(running_.size())) return nullptr;
  Running& fresh = running_[static_cast<std::size_t>(count_++)];
  fresh = {effect.index, effect.start, now, -1, proxy, true, {}, false, 0, 0};
  return &fresh;
}

// A surface that rubs belongs to the world; a view that jumps leaves it to the hand, as does one that a
// reset ended.
void Effects::moveWithView(const scene::SceneSnapshot& scene, const Vec3& proxy) noexcept {
  const Affine T_world_before = std::exchange(T_world_device_, scene.workspace.T_world_device);
  if (T_world_before.matrix() == T_world_device_.matrix()) return;
  const ViewMotion motion{scene.workspace.T_device_world, T_world_before};
  if (motion.jumpsAt(proxy)) return;
  for (const Effect& effect : scene.effects) {
    Running* const r = effect.onDevice ? nullptr : find(effect);
    if (r != nullptr) r->anchor = motion.of(r->anchor);
  }
}

void Effects::forgetUnseen() noexcept {
  const auto last = running_.begin() + count_;
  const auto end = std::remove_if(running_.begin(), last, [](const Running& r) { return !r.seen; });
  count_ = static_cast<int>(end - running_.begin());
}

Vec3 Effects::forceOf(const Effect& effect, Running& r, const Affine& T_device_world,
                      const device::DeviceState& device, const Rendering& contact, Nanos now) noexcept {
  switch (effect.type) {
    case EffectType::constant:
      return effect.magnitude_N * rotated(T_device_world, effect.direction).stableNormalized();
    case EffectType::spring:
      return atMost(effect.gain * (T_device_world * effect.position - contact.proxy_m), effect.magnitude_N);
    case EffectType::viscous:
      return atMost(-effect.gain * device.velocity_m_per_s, effect.magnitude_N);
    case EffectType::friction:
      r.changeFriction(effect.gain, effect.magnitude_N, contact.proxy_m);
      return frictionForce(effect.gain, effect.magnitude_N, contact.proxy_m, r.anchor);
    case EffectType::motorVibration: {
      const double phase = r.phase.at(now, r.begin, effect.angularFrequency_rad_per_s);
      const Vec3 force = effect.magnitude_N * Vec3(std::cos(phase), std::sin(phase), 0);
      return effect.inDeviceFrame ? force : Vec3(device.orientation * force);
    }
    case EffectType::contactVibration:
      return effect.magnitude_N * std::sin(r.phase.at(now, r.begin, effect.angularFrequency_rad_per_s)) *
             contact.normal;  // zero without contact
  }
  return Vec3::Zero();
}

Vec3 Effects::force(const scene::SceneSnapshot& scene, const device::DeviceState& device,
                    const Rendering& contact, double pressed_N, Nanos now) noexcept {
  moveWithView(scene, contact.proxy_m);
  const bool anew = std::exchange(anew_, false);
  for (int i = 0; i < count_; ++i) {
    Running& running = running_[static_cast<std::size_t>(i)];
    running.seen = false;
    if (anew) running.anchor = contact.proxy_m;
  }
  const Affine& T_device_world = scene.workspace.T_device_world;
  Vec3 sum = Vec3::Zero();
  double alongNormal = 0;
  for (const Effect& effect : scene.effects) {
    Running* r = running(effect, now, contact.proxy_m);
    if (r == nullptr) continue;
    r->seen = true;
    const bool ended = effect.duration > 0 && now - r->begin >= effect.duration;
    if (ended || effect.type != EffectType::friction) r->anchorAt(contact.proxy_m);
    if (ended) continue;
    Vec3 force = forceOf(effect, *r, T_device_world, device, contact, now);
    if (effect.releasing && r->releaseBegin < 0) r->releaseBegin = now;
    force *= remainingShare(r->releaseBegin, effect.owner.get(), now);
    if (effect.type == EffectType::contactVibration) {
      alongNormal += force.dot(contact.normal);
    } else {
      sum += force;
    }
  }
  forgetUnseen();
  // A surface that vibrates lets go at most; it does not pull.
  if (!contactVibrationPulls_) alongNormal = std::max(alongNormal, -std::max(0.0, pressed_N));
  return sum + alongNormal * contact.normal;
}

}  // namespace hapticd::realtime

#include "device/evdev/force_effects.h"

#include <algorithm>
#include <cmath>

namespace hapticd::device {
namespace {

constexpr double kFullLevel = 0x7fff;
constexpr __u16 kRight = 0xC000;

// Angle from "down" (towards the user) through "left".
__u16 directionOf(double x, double z) noexcept {
  const double turns = std::atan2(-x, z) / (2 * M_PI);
  return static_cast<__u16>(static_cast<int>(std::lround(turns * 65536)) & 0xffff);
}

}  // namespace

ForceEffects::ForceEffects(EventDevice& file, const WheelProfile& profile, bool twoAxes,
                           bool hasDamper) noexcept
    : file_(file), profile_(profile), twoAxes_(twoAxes), hasDamper_(hasDamper && profile.damper > 0) {
  constant_.type = FF_CONSTANT;
  constant_.id = -1;
  constant_.direction = kRight;
  damper_.type = FF_DAMPER;
  damper_.id = -1;
  for (ff_condition_effect& axis : damper_.u.condition) {
    axis.right_saturation = axis.left_saturation = 0xffff;
    axis.right_coeff = axis.left_coeff = static_cast<__s16>(kFullLevel * profile.damper);
  }
}

bool ForceEffects::begin() noexcept {
  // A device without adjustable gain or centring refuses these calls, which is harmless.
  send(FF_GAIN, 0xffff);
  send(FF_AUTOCENTER, 0);
  if (hasDamper_ && !upload(damper_)) return false;
  return upload(constant_) && play(constant_, true);
}

bool ForceEffects::set(double x_N, double z_N) noexcept {
  const double sign = profile_.invertForce ? -1 : 1;
  const double x = sign * x_N / profile_.force_N;
  const double z = twoAxes_ ? sign * z_N / profile_.force_N : 0;
  ff_effect wanted = constant_;
  if (twoAxes_) {
    const double size = std::min(std::hypot(x, z), 1.0);
    wanted.u.constant.level = static_cast<__s16>(std::lround(kFullLevel * size));
    if (wanted.u.constant.level != 0) wanted.direction = directionOf(x, z);
  } else {
    wanted.u.constant.level = static_cast<__s16>(std::lround(kFullLevel * std::clamp(x, -1.0, 1.0)));
  }
  if (wanted.u.constant.level != constant_.u.constant.level || wanted.direction != constant_.direction) {
    if (!upload(wanted)) return false;
    constant_ = wanted;
  }
  const bool damping = hasDamper_ && constant_.u.constant.level != 0;
  if (damping != damping_) {
    if (!play(damper_, damping)) return false;
    damping_ = damping;
  }
  return true;
}

void ForceEffects::end() noexcept {
  for (ff_effect* effect : {&constant_, &damper_}) {
    if (effect->id < 0) continue;
    play(*effect, false);
    file_.control(EVIOCRMFF, reinterpret_cast<void*>(static_cast<long>(effect->id)));
    effect->id = -1;
  }
}

bool ForceEffects::upload(ff_effect& effect) noexcept {
  return file_.control(EVIOCSFF, &effect);
}

bool ForceEffects::play(const ff_effect& effect, bool on) noexcept {
  return send(static_cast<unsigned short>(effect.id), on ? 1 : 0);
}

bool ForceEffects::send(unsigned short code, int value) noexcept {
  input_event event{};
  event.type = EV_FF;
  event.code = code;
  event.value = value;
  return file_.write(&event, sizeof event);
}

}  // namespace hapticd::device

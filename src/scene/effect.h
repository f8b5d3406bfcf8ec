// Force effects of the scene, in the units of the client.
//
// To add one: its type and its line in kEffectKinds here, its force in realtime/render/effects.cpp, and its
// function in include/hapticd/scene.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

#include "base/time.h"
#include "geometry/types.h"
#include "scene/force_owner.h"

namespace hapticd::scene {

enum class EffectType { constant, spring, viscous, friction, motorVibration, contactVibration };

/// A name that clients give an effect, and which parameters this type uses: the others are ignored.
struct EffectKind {
  std::string_view name;
  EffectType type;
  bool gain, duration, frequency, position, direction;
};
inline constexpr EffectKind kEffectKinds[] = {
    {"constant", EffectType::constant, false, true, false, false, true},
    {"spring", EffectType::spring, true, true, false, true, false},
    {"viscous", EffectType::viscous, true, true, false, false, false},
    {"friction", EffectType::friction, true, true, false, false, false},
    {"vibrationMotor", EffectType::motorVibration, false, true, true, false, false},
    {"motorVibration", EffectType::motorVibration, false, true, true, false, false},
    {"vibrationContact", EffectType::contactVibration, false, true, true, false, false},
    {"contactVibration", EffectType::contactVibration, false, true, true, false, false},
};

/// Of the effects that do not ramp out. A reset lets all of them ramp out at once.
inline constexpr std::size_t kMaxEffects = 64;
/// Of those that still ramp out then, after an earlier one.
inline constexpr std::size_t kMostOfEarlierReset = 8;

/// A running effect. The servo starts its clock and phase when it first sees a new `start` number.
struct Effect {
  std::int32_t index = 0;
  EffectType type = EffectType::constant;
  double gain = 0;                                    ///< N/m (spring, friction) or N·s/m (viscous)
  double magnitude_N = 0;                             ///< force, or its limit
  base::Nanos duration = 0;                           ///< 0: until stopped
  double angularFrequency_rad_per_s = 0;              ///< vibrations
  geometry::Vec3 position = geometry::Vec3::Zero();   ///< world units
  geometry::Vec3 direction = geometry::Vec3::Zero();  ///< world frame, not normalised
  std::uint32_t start = 0;                            ///< counts starts of this index
  bool inDeviceFrame = false;  ///< motor vibration on the device's x and y instead of the stylus'
  bool releasing = false;      ///< its owner is gone: ramp out in 250 ms
  bool onDevice = false;       ///< its place has left the world: no view moves it
  std::shared_ptr<const ForceOwner> owner;  ///< null: of no client
};

}  // namespace hapticd::scene

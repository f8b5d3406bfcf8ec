// The two effects that the driver keeps on a device: a constant force, changed in place, and a damper.
#pragma once

#include <linux/input.h>

#include "device/evdev/event_device.h"
#include "device/evdev/wheel_profile.h"

namespace hapticd::device {

/// For one thread. Forces are in newtons along x (to the right) and z (to the user).
class ForceEffects {
 public:
  /// `file` outlives it.
  ForceEffects(EventDevice& file, const WheelProfile& profile, bool twoAxes, bool hasDamper) noexcept;

  /// Uploads both effects, at rest, and switches the device's own centring off. False with errno set.
  bool begin() noexcept;
  /// Changes the force if it differs from the previous one; false with errno set.
  bool set(double x_N, double z_N) noexcept;
  /// Removes the force; harmless when the device is gone.
  void end() noexcept;

 private:
  bool upload(ff_effect& effect) noexcept;
  bool play(const ff_effect& effect, bool on) noexcept;
  bool send(unsigned short code, int value) noexcept;

  EventDevice& file_;
  const WheelProfile profile_;
  const bool twoAxes_;
  const bool hasDamper_;
  ff_effect constant_{};
  ff_effect damper_{};
  bool damping_ = false;
};

}  // namespace hapticd::device

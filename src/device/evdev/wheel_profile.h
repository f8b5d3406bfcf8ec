// Forces and travel of a joystick or wheel, which the device does not report.
#pragma once

#include <filesystem>
#include <stdexcept>

namespace hapticd::device {

/// A profile file that cannot be used; the text names file, line, key and value.
class WheelProfileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Measured once per device, with a spring balance and a ruler where the hand holds it.
struct WheelProfile {
  bool measured = false;  ///< false: the cautious values below
  double force_N = 2;     ///< at full level
  double continuousForce_N = 1;
  double travelX_m = 0.10;  ///< from end to end
  double travelZ_m = 0.10;
  double stiffness_N_per_m = 100;  ///< the stiffest wall that does not buzz
  double damper = 0.2;             ///< 0 … 1: the device's own damper while it pushes
  bool invertForce = false;        ///< for kernel drivers with the opposite sign
  int axes = 0;                    ///< 1: x alone; 2: x and z; 0: from the device's capabilities

  /// Reads a TOML file with these names: force_N, continuous_force_N, travel_x_m, travel_z_m,
  /// stiffness_N_per_m, damper, invert_force, axes. Throws WheelProfileError, also for an unknown name.
  static WheelProfile load(const std::filesystem::path& file);
};

}  // namespace hapticd::device

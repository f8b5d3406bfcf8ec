// The width of gaps between faces that nothing passes.
#pragma once

#include <algorithm>

namespace hapticd::geometry {

/// Faces whose gaps are narrower than this are impassable, so the point tool touches them as a ball of half
/// the width. Exports and assembled scenes leave such gaps where faces do not share vertices.
inline constexpr double kGapTolerance_m = 10e-6;
/// The tolerance grows with the spacing of an object's float coordinates, up to this.
inline constexpr double kLargestGapTolerance_m = 50e-6;

/// Four units in the last place of floats of this size.
constexpr double fourFloatSteps(double largest) {
  return 4 * 0x1p-23 * largest;
}

/// The tolerance of an object whose vertices have coordinates of at most `largest_m` in its own frame, scaled
/// to the device.
constexpr double gapToleranceOf(double largest_m) {
  return std::clamp(fourFloatSteps(largest_m), kGapTolerance_m, kLargestGapTolerance_m);
}

}  // namespace hapticd::geometry

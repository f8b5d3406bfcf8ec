// What the test and the device in the other process share beside the driver's own channel.
#pragma once

#include <atomic>

namespace hapticd::device {

struct ObservedHand {
  std::atomic<double> x{0}, y{0}, z{0};     ///< m, from the test
  std::atomic<double> fx{0}, fy{0}, fz{0};  ///< N, what the device got last
  /// 1: crash in the next tick; 2: hang in it; 3: tell of a fault once, slowly; 4: told; 5: hang in the
  /// opening or a calibration; 6: be lost, and do not tell why; 7: be lost, and tell
  std::atomic<int> fault{0};
  std::atomic<int> calibrations{0};
  std::atomic<int> closed{0};
};

}  // namespace hapticd::device

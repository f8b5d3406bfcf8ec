// Measures the delay of a driver in its own process on this machine.
#pragma once

#include "loop_check.h"

namespace hapticd::apps {

struct IsolationCheck {
  int rounds = 0;
  Percentiles postToTick_us;  ///< from the driver process to the servo tick; each figure is the median over
                              ///< the rounds
};

/// Runs the simulated device in its own process, in several rounds, for `seconds` in total. Throws
/// std::runtime_error when the process cannot be started.
IsolationCheck measureIsolation(double seconds);

}  // namespace hapticd::apps

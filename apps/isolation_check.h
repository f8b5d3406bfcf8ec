// What a driver in a process of its own costs on this machine.
#pragma once

#include "loop_check.h"

namespace hapticd::apps {

struct IsolationCheck {
  int rounds = 0;
  Percentiles postToTick_us;  ///< each the median over the rounds; in one process there is no such way
};

/// Runs the simulated hand in a process of its own, in several rounds, for `seconds` in all. Throws
/// std::runtime_error when there can be no process.
IsolationCheck measureIsolation(double seconds);

}  // namespace hapticd::apps

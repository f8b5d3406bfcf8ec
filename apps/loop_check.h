// Measures the timing of the real servo loop with the simulated hand.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace hapticd::apps {

struct Percentiles {
  double p50 = 0;
  double p99 = 0;
  double max = 0;
};

struct LoopCheck {
  std::vector<std::string> setup;  ///< scheduling and memory lock as granted or refused, one sentence each
  std::uint64_t ticks = 0;
  std::uint64_t overruns = 0;  ///< ticks that started more than 0.5 ms late
  Percentiles wakeup_us;
  Percentiles compute_us;
};

/// Blocks for `seconds`. Throws std::runtime_error when the system refuses a thread.
LoopCheck measureLoop(double seconds);

}  // namespace hapticd::apps

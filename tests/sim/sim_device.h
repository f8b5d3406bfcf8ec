// A device that fails, hangs, leaps and says nonsense, with a person at it who must re-arm.
#pragma once

#include <functional>
#include <memory>

#include "device/simulated/simulated_device.h"
#include "sim/judge.h"
#include "sim/scheduler.h"

namespace hapticd::sim {

/// Probabilities for each tick that an episode begins.
struct DeviceFaults {
  double noState = 0;
  double notFinite = 0;
  double hold = 0;
  double fault = 0;
  double leap = 0;
  double refuse = 0;
  double hang = 0;
  double lost = 0;
};

/// What the simulated device needs from the simulation: there is one at a time.
struct Bench {
  Scheduler& scheduler;
  base::Clock& clock;
  Dice dice;
  Judge& judge;
  DeviceFaults faults;
  bool ownLoop = false;                               ///< it calls the servo, as a vendor's library does
  std::function<void(const Vec3&)> wrote;             ///< every write, for the hash
  std::function<void(std::uint32_t)> buttonsChanged;  ///< as delivered
  std::function<void(const std::string&)> finding;
  std::uint64_t injected = 0;
  bool quiet = false;  ///< no further episodes
  bool lost = false;   ///< the cable is unplugged
};

/// Puts a bench in place for as long as it lives.
class ScopedBench {
 public:
  explicit ScopedBench(Bench& bench);
  ~ScopedBench();
  ScopedBench(const ScopedBench&) = delete;
  ScopedBench& operator=(const ScopedBench&) = delete;
};

}  // namespace hapticd::sim

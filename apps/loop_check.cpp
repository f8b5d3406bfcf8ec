#include "loop_check.h"
#include "base/clock.h"

#include <chrono>
#include <thread>

#include "device/simulated/simulated_device.h"
#include "realtime/servo/servo_thread.h"
#include "realtime/servo/tick.h"

namespace hapticd::apps {
namespace {

Percentiles percentiles(const base::Histogram& histogram) {
  const auto copy = histogram.copy();
  const auto us = [](base::Nanos t) { return static_cast<double>(t) * 1e-3; };
  return {us(copy.quantile(0.5)), us(copy.quantile(0.99)), us(copy.max)};
}

}  // namespace

LoopCheck measureLoop(double seconds) {
  device::SimulatedDevice device;
  device.open();
  base::MonotonicClock clock;
  realtime::Tick tick(device, clock);
  realtime::ServoThread servo([&](const realtime::Pacing& pacing) { tick(pacing); }, clock);

  LoopCheck check;
  for (const realtime::SetupAnswer* answer : servo.start().all()) {
    if (answer->asked)
      check.setup.push_back(answer->granted ? answer->text : answer->text + "; " + answer->remedy);
  }
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  servo.stop();
  tick.finish();
  check.ticks = tick.last().tick;
  check.overruns = tick.last().timing.overruns;
  check.wakeup_us = percentiles(tick.histograms().wakeupError);
  check.compute_us = percentiles(tick.histograms().compute);
  return check;
}

}  // namespace hapticd::apps

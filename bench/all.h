// Each benchmark has a file of its own; benchmarks() lists them.
#pragma once

#include "bench/benchmark.h"

namespace hapticd::bench {

Outcome measureTick(const Run& run);
Outcome measureObjects(const Run& run);
Outcome measureWakeup(const Run& run);
Outcome measureDisturbance(const Run& run);
Outcome measureStop(const Run& run);
Outcome measureHandover(const Run& run);
Outcome measureBurden(const Run& run);
Outcome measureRemote(const Run& run);
Outcome measureLatency(const Run& run);
Outcome measureUpload(const Run& run);
Outcome measureFanOut(const Run& run);
Outcome measureAge(const Run& run);
Outcome measureDeform(const Run& run);
Outcome measureMemory(const Run& run);

/// The driver's process of measureHandover().
int hostStrokingDevice();

}  // namespace hapticd::bench

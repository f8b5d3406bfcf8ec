// How long the machine has been suspended.
#pragma once

#include "base/time.h"

namespace hapticd::base {

/// Total time of suspension since the machine started: CLOCK_BOOTTIME less CLOCK_MONOTONIC, to within some
/// microseconds. Realtime: one thread may call it in every step.
Nanos suspendedTime() noexcept;

}  // namespace hapticd::base

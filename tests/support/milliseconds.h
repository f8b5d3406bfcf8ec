// One millisecond of a servo clock, for tests that count ticks.
#pragma once

#include "base/time.h"

namespace hapticd {

inline constexpr base::Nanos kMs = 1'000'000;

}  // namespace hapticd

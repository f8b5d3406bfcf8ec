#include "realtime/servo/pacer.h"

#include <stdexcept>
#include <string>

#include "base/time.h"

namespace hapticd::realtime {

Nanos servoPeriod(double rate_Hz) {
  if (!(rate_Hz >= kMinServoRate_Hz && rate_Hz <= kMaxServoRate_Hz)) {
    throw std::invalid_argument("servo rate " + std::to_string(rate_Hz) + " Hz is outside 250 … 4000 Hz");
  }
  return base::toNanos(1.0 / rate_Hz);
}

}  // namespace hapticd::realtime

// Inputs and result of one tick: enough to render it again.
#pragma once

#include "handoff/spsc_ring.h"
#include "realtime/servo/guard_control.h"
#include "realtime/servo/report.h"

namespace hapticd::realtime {

/// A plain value without pointers. The report holds the pacing: time, wake-up error, overruns, skipped
/// periods.
struct TickRecord {
  TickReport report;
  GuardControl::Seen control{};  ///< as the guard read it in this tick
  bool haveState = false;        ///< the device delivered a state
  bool written = false;          ///< the device accepted the force
  bool discarded = false;        ///< the rendered force was too old; zero was written
};

/// From the servo to a recorder. A full ring counts the records that it refuses.
using RecordRing = handoff::SpscRing<TickRecord>;

}  // namespace hapticd::realtime

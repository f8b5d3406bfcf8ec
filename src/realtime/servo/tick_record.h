// All that one tick was made of and what came of it: enough to do it again.
#pragma once

#include "handoff/spsc_ring.h"
#include "realtime/servo/guard_control.h"
#include "realtime/servo/report.h"

namespace hapticd::realtime {

/// A plain value without pointers. The pacing is in the report: time, wake-up error, overruns, skipped
/// periods.
struct TickRecord {
  TickReport report;
  GuardControl::Seen control{};  ///< as the guard saw it in this tick
  bool haveState = false;        ///< the device gave a state
  bool written = false;          ///< the device took the force
};

/// Servo to a recorder. A full ring counts what it refused.
using RecordRing = handoff::SpscRing<TickRecord>;

}  // namespace hapticd::realtime

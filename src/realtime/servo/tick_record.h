// Inputs and result of one tick: enough to render it again.
#pragma once

#include "handoff/spsc_ring.h"
#include "realtime/remote/remote_input.h"
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
};

/// From the servo to a recorder. A full ring counts the records that it refuses.
using RecordRing = handoff::SpscRing<TickRecord>;

/// What clients streamed, in the first tick that knew it.
struct StreamRecord {
  std::uint64_t tick = 0;
  RemoteInput input;
};

/// From the servo to a recorder. The input of a tick is in this ring before the tick is in its own.
using StreamRing = handoff::SpscRing<StreamRecord>;

}  // namespace hapticd::realtime

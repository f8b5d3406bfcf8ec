// Inputs and result of one tick: enough to render it again.
#pragma once

#include "handoff/spsc_ring.h"
#include "realtime/remote/remote_input.h"
#include "realtime/remote/remote_memory.h"
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
  bool expired = false;          ///< the device had ended the force of the tick before by itself
};

/// From the servo to a recorder. A full ring counts the records that it refuses.
using RecordRing = handoff::SpscRing<TickRecord>;

/// What the servo knows of the ticks before a recording that begins while it runs: enough to render on after
/// a tick.
struct ServoMemory {
  std::uint64_t tick = 0;  ///< after this tick
  bool whole = false;      ///< false: more is needed to render on, as in contact; another follows
  RenderMemory render;
  GuardMemory guard;
  RemoteMemory remote;
};

/// From the servo to a recorder: the memory of the first recorded tick and, unless that is whole, of the
/// first tick after which it is. In this ring before the tick is in its own.
using MemoryRing = handoff::SpscRing<ServoMemory>;

/// What clients streamed, in the first tick that knew it.
struct StreamRecord {
  std::uint64_t tick = 0;
  RemoteInput input;
};

/// From the servo to a recorder. The input of a tick is in this ring before the tick is in its own.
using StreamRing = handoff::SpscRing<StreamRecord>;

}  // namespace hapticd::realtime

// The report of one tick.
#pragma once

#include <cstdint>

#include "device/device.h"
#include "handoff/spsc_ring.h"
#include "realtime/remote/remote_report.h"
#include "realtime/render/renderer.h"
#include "realtime/servo/guard.h"

namespace hapticd::realtime {

/// Timing of one tick, and totals of overruns.
struct TickTiming {
  Nanos period = 0;       ///< since the start of the previous tick; 0 in the first
  Nanos wakeupError = 0;  ///< start minus deadline
  Nanos compute = 0;      ///< from the start until the force was written
  std::uint64_t overruns = 0;
  std::uint64_t skippedPeriods = 0;
};

/// A plain value without pointers: a copy neither allocates nor throws. Device frame unless a name says
/// otherwise.
struct TickReport {
  std::uint64_t tick = 0;       ///< from 1
  Nanos time = 0;               ///< start of the tick on the servo clock
  std::uint64_t revision = 0;   ///< of the rendered snapshot; 0 before the first
  device::DeviceState device;   ///< the last state that the device delivered
  Rendering rendering;          ///< its total force includes the remote one
  RemoteRendering remote;       ///< of what clients stream; not recorded, re-rendering makes it again
  Vec3 force_N = Vec3::Zero();  ///< as written to the device
  GuardReport guard;
  TickTiming timing;
  Affine T_world_device = Affine::Identity();  ///< of the workspace of that snapshot
  std::uint64_t dropped = 0;                   ///< number of earlier reports that a full ring refused
};

/// From the servo to the net thread. Every report that the ring did not refuse arrives, in order.
using ReportRing = handoff::SpscRing<TickReport>;

}  // namespace hapticd::realtime

// What one tick did, as it leaves the servo.
#pragma once

#include <cstdint>

#include "device/device.h"
#include "handoff/spsc_ring.h"
#include "realtime/render/renderer.h"
#include "realtime/servo/guard.h"

namespace hapticd::realtime {

/// When a tick was due, when it began, how long it took.
struct TickTiming {
  Nanos period = 0;       ///< since the start of the tick before; 0 in the first
  Nanos wakeupError = 0;  ///< start less deadline
  Nanos compute = 0;      ///< from the start until the force was written
  std::uint64_t overruns = 0;
  std::uint64_t skippedPeriods = 0;
};

/// A plain value without pointers: copying it neither allocates nor throws. Device frame unless named
/// otherwise.
struct TickReport {
  std::uint64_t tick = 0;      ///< from 1
  Nanos time = 0;              ///< start of the tick on the servo clock
  std::uint64_t revision = 0;  ///< of the snapshot that was rendered; 0 before the first
  device::DeviceState device;  ///< the last state the device gave
  Rendering rendering;
  Vec3 force_N = Vec3::Zero();  ///< as written to the device
  GuardReport guard;
  TickTiming timing;
  Affine T_world_device = Affine::Identity();  ///< of that snapshot's workspace
  std::uint64_t dropped = 0;                   ///< reports before this one that found the ring full
};

/// Servo to the edge. Every report that was not dropped arrives, in order.
using ReportRing = handoff::SpscRing<TickReport>;

}  // namespace hapticd::realtime

// One tick of the servo loop, and all state from tick to tick.
//
// A tick is a function: a ServoThread paces it, the callback of a vendor library can call it, and offline
// rendering calls it as fast as possible. Only one thread may call it at a time.
#pragma once

#include <cstddef>

#include "base/clock.h"
#include "base/histogram.h"
#include "device/device.h"
#include "handoff/latest_value.h"
#include "realtime/remote/held_force.h"
#include "realtime/remote/remote_contacts.h"
#include "realtime/render/renderer.h"
#include "realtime/servo/black_box.h"
#include "realtime/servo/guard.h"
#include "realtime/servo/pacer.h"
#include "realtime/servo/report.h"
#include "realtime/servo/tick_record.h"
#include "realtime/servo/wake.h"
#include "scene/snapshot_slot.h"

namespace hapticd::realtime {

struct TickOptions {
  double rate_Hz = 1000;  ///< nominal; 250 … 4000
  RenderOptions render;
  GuardOptions guard;
  std::size_t reports = 1024;  ///< capacity of the ring
  double blackBox_s = 2;
};

/// Periods, wake-up errors and compute times of all ticks. Any thread may read.
struct TickHistograms {
  base::Histogram period;
  base::Histogram wakeupError;
  base::Histogram compute;
};

/// The servo loop of one device. Construct it outside the loop: the constructor makes all allocations.
class Tick {
 public:
  /// `device` must be open; it and `clock` must outlive the tick. Throws std::invalid_argument for a rate
  /// outside 250 Hz … 4 kHz and std::system_error when the system has no descriptor for the wake.
  Tick(device::Device& device, base::Clock& clock, const TickOptions& options = {});
  Tick(const Tick&) = delete;
  Tick& operator=(const Tick&) = delete;

  /// One tick: read → render → guard → write → report. Realtime: noexcept, no allocation, no lock; the only
  /// system calls are the clock and one non-blocking wake.
  void operator()(const Pacing& pacing) noexcept;
  /// The same for a caller without deadlines.
  void operator()(Nanos now) noexcept { (*this)(Pacing{now, 0, 0, 0}); }
  /// After the last tick, from any thread: writes zero force.
  void finish() noexcept { device_.write(Vec3::Zero()); }

  /// Before the first tick: records every tick to `ring` as well, which must outlive this object.
  void recordTo(RecordRing* ring) noexcept { recordTo_ = ring; }
  /// The same for what clients stream.
  void recordTo(StreamRing* ring) noexcept { recordStreamTo_ = ring; }

  /// Scene thread: publishes snapshots and collects old ones.
  scene::SnapshotSlot& snapshots() noexcept { return snapshots_; }
  /// For the one writer of what clients stream: the next tick takes the newest value.
  handoff::LatestValue<RemoteInput>& remote() noexcept { return remoteInput_; }
  /// For the one consumer of reports.
  ReportRing& reports() noexcept { return reports_; }
  /// Notified once per tick.
  Wake& wake() noexcept { return wake_; }
  /// Any thread.
  GuardControl& control() noexcept { return control_; }
  const TickHistograms& histograms() const noexcept { return histograms_; }
  BlackBox& blackBox() noexcept { return blackBox_; }
  /// The report of the last tick, for the thread that calls the tick.
  const TickReport& last() const noexcept { return report_; }

 private:
  void begin(const Pacing& pacing) noexcept;
  const scene::SceneSnapshot& takeSnapshot() noexcept;
  void addRemote(Nanos period) noexcept;
  GuardInput guardInput() const noexcept;
  void publish() noexcept;

  device::Device& device_;
  base::Clock& clock_;
  const Nanos period_;
  const scene::SceneSnapshot nothing_;  // before the first snapshot
  scene::SnapshotSlot snapshots_;
  Renderer renderer_;
  handoff::LatestValue<RemoteInput> remoteInput_;
  RemoteContacts remoteContacts_;
  HeldForceLaw heldForce_;
  std::uint64_t contactsSeen_ = 0;
  std::uint64_t forceSeen_ = 0;
  GuardControl control_;
  Guard guard_;
  ReportRing reports_;
  Wake wake_;
  BlackBox blackBox_;
  TickHistograms histograms_;
  TickReport report_;
  RecordRing* recordTo_ = nullptr;
  StreamRing* recordStreamTo_ = nullptr;
  bool haveState_ = false;  // the device delivered a state in this tick
  bool written_ = true;     // the device accepted the last force
};

}  // namespace hapticd::realtime

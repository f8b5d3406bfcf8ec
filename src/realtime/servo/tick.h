// One turn of the servo loop, and everything that lives from turn to turn.
//
// A tick is a function: a ServoThread paces it, a device's own callback can call it, and offline rendering
// calls it as fast as it can. Only one thread may call it at a time.
#pragma once

#include <cstddef>

#include "device/device.h"
#include "scene/snapshot_slot.h"
#include "realtime/render/renderer.h"
#include "realtime/servo/black_box.h"
#include "base/clock.h"
#include "realtime/servo/guard.h"
#include "realtime/servo/histogram.h"
#include "realtime/servo/pacer.h"
#include "realtime/servo/report.h"
#include "realtime/servo/tick_record.h"
#include "realtime/servo/wake.h"

namespace hapticd::realtime {

struct TickOptions {
  double rate_Hz = 1000;  ///< nominal; 250 … 4000
  RenderOptions render;
  GuardOptions guard;
  std::size_t reports = 1024;  ///< that the ring can hold
  double blackBox_s = 2;
};

/// Periods, wake-up errors and compute times of all ticks. Any thread reads.
struct TickHistograms {
  Histogram period;
  Histogram wakeupError;
  Histogram compute;
};

/// The servo loop of one device. Construct outside the loop: takes all its memory at once.
class Tick {
 public:
  /// `device` is open; it and `clock` outlive the tick. Throws std::invalid_argument for a rate outside
  /// 250 Hz … 4 kHz and std::system_error when there is no descriptor for the wake.
  Tick(device::Device& device, base::Clock& clock, const TickOptions& options = {});
  Tick(const Tick&) = delete;
  Tick& operator=(const Tick&) = delete;

  /// One turn: read → render → guard → write → report. Realtime: noexcept, no allocation, no lock; enters
  /// the system for the clock and one non-blocking wake.
  void operator()(const Pacing& pacing) noexcept;
  /// The same for a caller that has no deadlines of its own.
  void operator()(Nanos now) noexcept { (*this)(Pacing{now, 0, 0, 0}); }
  /// After the last turn, in any thread: leaves no force behind.
  void finish() noexcept { device_.write(Vec3::Zero()); }

  /// Before the first turn: from now on every turn goes to `ring` as well, which outlives the tick.
  void recordTo(RecordRing* ring) noexcept { recordTo_ = ring; }

  /// Scene thread: publish and collect.
  scene::SnapshotSlot& snapshots() noexcept { return snapshots_; }
  /// The one consumer of reports.
  ReportRing& reports() noexcept { return reports_; }
  /// Notified once in each tick.
  Wake& wake() noexcept { return wake_; }
  /// Any thread.
  GuardControl& control() noexcept { return control_; }
  const TickHistograms& histograms() const noexcept { return histograms_; }
  BlackBox& blackBox() noexcept { return blackBox_; }
  /// The report of the last turn, for the thread that calls it.
  const TickReport& last() const noexcept { return report_; }

 private:
  void begin(const Pacing& pacing) noexcept;
  const scene::SceneSnapshot& takeSnapshot() noexcept;
  GuardInput guardInput() const noexcept;
  void publish() noexcept;

  device::Device& device_;
  base::Clock& clock_;
  const Nanos period_;
  const scene::SceneSnapshot nothing_;  // before the first snapshot
  scene::SnapshotSlot snapshots_;
  Renderer renderer_;
  GuardControl control_;
  Guard guard_;
  ReportRing reports_;
  Wake wake_;
  BlackBox blackBox_;
  TickHistograms histograms_;
  TickReport report_;
  RecordRing* recordTo_ = nullptr;
  bool haveState_ = false;  // the device gave a state in this turn
  bool written_ = true;     // the device took the last force
};

}  // namespace hapticd::realtime

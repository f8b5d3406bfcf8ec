// One tick of the servo loop, and all state from tick to tick.
//
// A tick is a function: a ServoThread paces it, the callback of a vendor library can call it, and offline
// rendering calls it as fast as possible. Only one thread may call it at a time.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>

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
#include "realtime/servo/remote_passivity.h"
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
  Nanos forceLife = 0;  ///< of the device: DeviceTraits::forceLife
};

/// A tick that takes longer than this until its write commands zero instead: its force belongs to the past.
inline constexpr Nanos kOldestForce = 3'000'000;

/// A hand of which no tick knew the position for longer than this, and which is then found farther away than
/// that, came on a way that nobody saw: nothing holds it that it did not touch since.
inline constexpr Nanos kOutOfSight = 50'000'000;
inline constexpr double kElsewhere_m = 0.005;

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

  /// Where to record. Rings that were given must live until a tick that began after their end has finished.
  struct Rings {
    RecordRing* ticks = nullptr;  ///< null: nowhere
    StreamRing* streams = nullptr;
    MemoryRing* memories = nullptr;  ///< null: the recording begins with the first tick
    /// Of the scene in the recording: a memory belongs to no older one. kUnknown: rememberFrom() follows.
    std::uint64_t revision = 0;
    static constexpr std::uint64_t kUnknown = std::numeric_limits<std::uint64_t>::max();
  };
  /// From any thread: records every tick from the next one on, and what clients stream, to the rings as well.
  void recordTo(const Rings& rings) noexcept {
    recordTo_.store(nullptr, std::memory_order_release);
    recordStreamTo_.store(rings.streams, std::memory_order_release);
    rememberTo_.store(rings.memories, std::memory_order_release);
    rememberFrom_.store(rings.revision, std::memory_order_release);
    recordTo_.store(rings.ticks, std::memory_order_release);
  }
  /// From any thread, while it records: a memory belongs to no older revision.
  void rememberFrom(std::uint64_t revision) noexcept {
    rememberFrom_.store(revision, std::memory_order_release);
  }
  /// For a replay that begins between two ticks: the next one follows this one, which was the last and free
  /// of contact.
  void resume(const TickReport& last) noexcept;
  /// The same with all that the servo knew then.
  void resume(const TickReport& last, const ServoMemory& memory) noexcept;

  /// Scene thread: publishes snapshots and collects old ones.
  scene::SnapshotSlot& snapshots() noexcept { return snapshots_; }
  /// For the one writer of what clients stream: the next tick takes the newest value.
  handoff::LatestValue<RemoteInput>& remote() noexcept { return remoteInput_; }
  /// Any thread: when the last tick ended, on the clock of the constructor; 0 before the first.
  Nanos finishedAt() const noexcept { return finishedAt_.load(std::memory_order_acquire); }
  /// One other thread, while the loop runs: ends the force of a servo that does not finish its tick. That
  /// tick commands zero if it ever comes to its write, and later forces ramp in. False when the driver cannot
  /// end the force from this thread.
  bool overtake() noexcept {
    overtakes_.fetch_add(1, std::memory_order_acq_rel);
    return device_.zeroFromOtherThread();
  }
  /// Any thread: the last tick saw stop(), and the device has its zero.
  bool stoppedAtZero() const noexcept { return stoppedAtZero_.load(std::memory_order_acquire); }
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
  bool lookForHand() noexcept;
  bool handIsLost() const noexcept;
  void feelNothing() noexcept;
  const RemoteContactSet& inThisView(const RemoteContactSet& newest, bool fresh) noexcept;
  void addRemote(Nanos period, bool foundAnew, double passedShare) noexcept;
  GuardInput guardInput() const noexcept;
  bool forceOutlived() noexcept;
  void write(Nanos started, std::uint32_t overtakes) noexcept;
  void discardForce() noexcept;
  void publish() noexcept;
  void remember(MemoryRing* ring) noexcept;
  bool rememberRemote() noexcept;

  // Time and place of the last position that the device reported.
  struct Sight {
    bool ever = false;
    bool calibrated = true;
    Nanos time = 0;  // of the tick
    Vec3 place_m = Vec3::Zero();
  };

  device::Device& device_;
  base::Clock& clock_;
  const Nanos period_;
  const Nanos forceLife_;
  const scene::SceneSnapshot nothing_;  // before the first snapshot
  scene::SnapshotSlot snapshots_;
  Renderer renderer_;
  handoff::LatestValue<RemoteInput> remoteInput_;
  RemoteContacts remoteContacts_;
  RemotePassivity remotePassivity_;
  HeldForceLaw heldForce_;
  Sight sight_;
  Affine T_world_before_ = Affine::Identity();  // the view of the last tick
  RemoteContactSet carried_;                    // stated in it and taken in this one
  std::uint64_t contactsSeen_ = 0;
  std::uint64_t forceSeen_ = 0;
  GuardControl control_;
  Guard guard_;
  ReportRing reports_;
  Wake wake_;
  BlackBox blackBox_;
  TickHistograms histograms_;
  TickReport report_;
  Nanos sceneSettledAt_ = 0;  // of the snapshot of this tick
  std::atomic<RecordRing*> recordTo_{nullptr};
  std::atomic<StreamRing*> recordStreamTo_{nullptr};
  std::atomic<MemoryRing*> rememberTo_{nullptr};
  std::atomic<std::uint64_t> rememberFrom_{0};
  MemoryRing* rememberedTo_ = nullptr;
  ServoMemory memory_;      // for that ring
  bool haveState_ = false;  // the device delivered a state in this tick
  bool written_ = true;     // the device accepted the last force
  bool expired_ = false;    // the device ended the last force before this tick
  bool discarded_ = false;  // the force of this tick was too old: zero was written
  Nanos wrote_ = -1;        // shortly before the last write; -1: nothing written yet
  std::atomic<Nanos> finishedAt_{0};
  std::atomic<std::uint32_t> overtakes_{0};
  std::atomic<bool> stoppedAtZero_{false};
};

}  // namespace hapticd::realtime

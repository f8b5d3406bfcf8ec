// The real servo loop in this process, with a hand that strokes the ball: for benchmarks that disturb it.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "base/clock.h"
#include "bench/samples.h"
#include "bench/scenes.h"
#include "realtime/servo/servo_thread.h"
#include "realtime/servo/tick.h"

namespace hapticd::bench {

/// A hand that goes one step further in each tick, whatever pushes it; in the air until told to begin.
class StrokingDevice final : public device::Device {
 public:
  void open() override {}
  void close() noexcept override {}
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(base::Nanos now, device::DeviceState& state) noexcept override;
  bool write(const Vec3& /*force_N*/) noexcept override { return true; }
  void begin() noexcept { begun_.store(true, std::memory_order_release); }

 private:
  std::atomic<bool> begun_{false};
  const std::vector<HandTick> hand_ = handOf(2);
  std::size_t next_ = 0;
  device::DeviceProfile profile_;
};

/// What the ticks of a while were like, microseconds.
struct LoopFigures {
  Samples wakeup_us;
  Samples compute_us;
  std::uint64_t overruns = 0;  ///< starts more than 0.5 ms late
};

/// Runs from construction to destruction, with realtime rights if they are granted.
class ServoLoop {
 public:
  ServoLoop();
  ~ServoLoop();

  scene::SnapshotSlot& snapshots() noexcept { return tick_.snapshots(); }
  /// The hand begins to stroke; publish what it touches before.
  void begin() noexcept { device_.begin(); }
  bool realtimeGranted() const noexcept { return granted_; }
  /// Sleeps and tells what happened meanwhile; at most 60 s.
  LoopFigures observe(double seconds);

 private:
  struct Noted {
    std::int64_t wakeup_ns;
    std::int64_t compute_ns;
  };
  static constexpr std::size_t kMost = 65536;

  void turn(const realtime::Pacing& pacing) noexcept;

  StrokingDevice device_;
  base::MonotonicClock clock_;
  realtime::Tick tick_;
  realtime::ServoThread servo_;
  bool granted_ = false;
  std::vector<Noted> ring_;  // the last ticks, by number
  std::atomic<std::uint64_t> ticks_{0};
};

}  // namespace hapticd::bench

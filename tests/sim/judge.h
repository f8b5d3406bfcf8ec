// What must hold at the device, whatever the server does: a plain model of the promises of docs/safety.md. It
// sees what the device delivered and got, and when the server read stops and re-arms. It shares no code with
// the server.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "device/device.h"

namespace hapticd::sim {

using base::Nanos;
using geometry::Vec3;

class Judge {
 public:
  struct Limits {
    double peak_N = 3.3;
    double slew_N_per_s = 1000;
    double speed_m_per_s = 1.2;
    double calmSpeed_m_per_s = 0.3;
    int speedTicks = 3;
    Nanos period = 1'000'000;
    Nanos rampIn = 500'000'000;
    Nanos late = 20'000'000;     ///< a tick that is later has no force
    Nanos stalled = 50'000'000;  ///< and one that is later than this latches
    Nanos oldest = 3'000'000;    ///< a tick that takes longer until its write has no force
  };

  /// The top of the cube of late, a square around the axis of height.
  struct Top {
    double lowest_m;
    double highest_m;
    double halfWidth_m;
  };

  /// What the judge asks in every tick.
  struct Knowledge {
    std::function<void(const std::string&)> finding;
    /// Since when nobody has a right to a force; nothing when somebody has.
    std::function<std::optional<Nanos>()> freeFrom;
    std::function<std::optional<Top>()> top;  ///< nothing while unknown
  };

  Judge(Limits limits, Knowledge knowledge) : limits_(limits), knows_(std::move(knowledge)) {}

  // The device, in the servo's thread.
  void onRead(Nanos now, Nanos clock, bool delivered, const device::DeviceState& state);
  void onWrite(Nanos clock, const Vec3& force_N, bool accepted);

  // The network. Only the first of two stops in a row counts; a re-arm must be sent after a stop.
  void onStop(Nanos clock) { stops_.push_back(clock); }
  void onRearm(Nanos clock) { rearmed_ = clock; }
  /// The machine was suspended: forces are stopped within 100 ms.
  void onSuspended(Nanos clock) { suspended_ = clock; }

  std::uint64_t ticks() const noexcept { return ticks_; }
  /// Since the last tick began.
  Nanos sinceRead(Nanos clock) const noexcept { return clock - started_; }
  /// Total time by which ticks were late.
  Nanos stalled() const noexcept { return stalled_; }
  std::uint64_t ticksWithForce() const noexcept { return withForce_; }
  std::uint64_t ticksInside() const noexcept { return inside_; }
  std::uint64_t latches() const noexcept { return latches_; }
  bool held() const noexcept { return !holdReason_.empty() || latched_ || stopped_; }

 private:
  void latch(const std::string& why);
  void fail(Nanos clock, const std::string& text, const Vec3& force_N);

  const Limits limits_;
  const Knowledge knows_;

  std::vector<Nanos> stops_;  // not yet seen by a tick
  std::optional<Nanos> suspended_;
  bool outside_ = false;  // the hand was above the cube, and since then never beside it
  Nanos rearmed_ = -1;
  Nanos tick_ = 0;     // start of this one, as the servo calls it
  Nanos started_ = 0;  // the same on the clock
  Nanos stalled_ = 0;
  Nanos gap_ = 0;  // since the tick before
  bool first_ = true;
  bool pending_ = false;  // read, not written
  bool stopped_ = false;
  Nanos stoppedAt_ = 0;
  bool latched_ = false;
  Nanos latchedAt_ = 0;
  std::string latchReason_;
  std::string holdReason_;  // why this tick has no force
  int fast_ = 0;
  bool waitForCalm_ = false;
  bool refused_ = false;  // the device refused the last force
  Nanos zeroAt_ = 0;      // the last tick that had to be zero
  Vec3 written_N_ = Vec3::Zero();
  Vec3 position_m_ = Vec3::Zero();
  int deep_ = 0;
  std::uint64_t ticks_ = 0;
  std::uint64_t withForce_ = 0;
  std::uint64_t inside_ = 0;
  std::uint64_t latches_ = 0;
};

}  // namespace hapticd::sim

// Re-rendering: the recorded device states in the recorded scene, by the same renderer and guard.
//
// The builder gets every command and every call of publish() at the recorded times, with the readings of the
// stopwatch; the servo gets the state, pacing and control of every tick, and each revision in the tick that
// saw it. So, without changes, the same program on the same kind of machine gives the recorded forces bit for
// bit.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "record/recording.h"

namespace hapticd::record {

/// Differences from the recording; all else stays. Surface values apply to all objects and planes, within the
/// passivity bound unless raw.
struct RerenderChanges {
  std::optional<double> stiffness_N_per_m{};
  std::optional<double> damping_Ns_per_m{};
  std::optional<double> staticFriction{};
  std::optional<double> dynamicFriction{};
  std::optional<double> toolRadius_m{};
  std::optional<bool> forceShading{};
  bool raw = false;  ///< no guard, no passivity clamp, no limits of surfaces

  bool none() const noexcept;
  bool surfaces() const noexcept;
};

/// True when the two ticks agree in every bit of rendering, force and guard.
bool sameOutcome(const realtime::TickReport& a, const realtime::TickReport& b);

/// Feed it the events of a recording, in order.
class Rerenderer {
 public:
  explicit Rerenderer(const RecordingHeader& header, const RerenderChanges& changes = {});
  ~Rerenderer();

  /// For a tick, the re-rendered one, valid until the next call; null for all other events.
  const realtime::TickReport* feed(const RecordingEvent& event);
  /// False for the first ticks of a device whose recording began while the server ran: until it was free of
  /// contact, and nothing ramped, faded or was streamed any more.
  bool comparable(std::uint32_t device) const;
  /// False for a device whose recording began while the server ran, without what its servo knew: an older
  /// version wrote it.
  bool knowsPast(std::uint32_t device) const;

 private:
  struct Seat;

  void on(const SceneEvent& event);
  void on(const PublishEvent& event);
  void on(const StreamEvent& event);
  void on(const MemoryEvent& event);
  void on(const LeftEvent& event);
  const realtime::TickReport* on(const TickEvent& event);

  std::vector<std::unique_ptr<Seat>> seats_;
};

}  // namespace hapticd::record

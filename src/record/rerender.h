// A recorded session once more: the recorded hand through the recorded scene, by the same renderer and guard.
//
// The scene gets every command and every look of its builder at the recorded times, with what the stopwatch
// said; the servo gets every tick's state, pacing and control, and each revision in the tick that saw it. So
// with nothing changed the forces are the recorded ones bit for bit, by the same program on the same machine.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "record/recording.h"

namespace hapticd::record {

/// What to feel otherwise than it was recorded; everything else stays. Surfaces are those of all objects and
/// planes, and are kept passive as always unless raw.
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

/// True when the two ticks felt and did the same, in every bit: rendering, force and guard.
bool sameOutcome(const realtime::TickReport& a, const realtime::TickReport& b);

/// Feed it the events of a session, in order.
class Rerenderer {
 public:
  explicit Rerenderer(const RecordingHeader& header, const RerenderChanges& changes = {});
  ~Rerenderer();

  /// For a tick, what it is now; valid until the next call. Null for everything else.
  const realtime::TickReport* feed(const RecordingEvent& event);

 private:
  struct Seat;

  void on(const SceneEvent& event);
  void on(const PublishEvent& event);
  const realtime::TickReport* on(const TickEvent& event);

  std::vector<std::unique_ptr<Seat>> seats_;
};

}  // namespace hapticd::record

// From what clients say to what can be touched: applies commands, publishes snapshots.
//
// Pure and single-threaded: no thread, no socket, no clock but `now`. The server's scene thread drives it:
// apply what has come, publish, sleep until nextDeadline() or the next command.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "scene/commands.h"
#include "scene/config.h"
#include "scene/description.h"
#include "scene/notice.h"
#include "scene/snapshot.h"

namespace hapticd::scene {

/// The mutable scene. `now` is servo time and must not decrease from call to call.
class SceneBuilder {
 public:
  explicit SceneBuilder(SceneConfig config = {});
  ~SceneBuilder();
  SceneBuilder(SceneBuilder&&) noexcept;
  SceneBuilder& operator=(SceneBuilder&&) noexcept;

  /// Applies one command of a client, or queues it in the client's open batch. What is wrong with it is
  /// appended to `notices`, and the scene stays as it was.
  void apply(ClientId client, SceneCommand&& command, Nanos now, std::vector<Notice>& notices);

  /// The client has left: its open batch is dropped, the forces it owns ramp out.
  void clientGone(ClientId client, Nanos now);

  /// The forces that the client owns ramp out, although it stays.
  void releaseForces(ClientId client, Nanos now);

  /// When publish() has something to do although no command came; nothing to wait for when empty.
  std::optional<Nanos> nextDeadline() const;

  /// The oldest edit that is applied but not yet published: meshes wait for a pause between edits. Empty when all is
  /// published.
  std::optional<Nanos> oldestEdit() const;

  /// The scene as it is now, or null when nothing changed since the last time. The first call always gives
  /// one. Builds the meshes that are due, which may take long; appends notices that became due.
  std::shared_ptr<const SceneSnapshot> publish(Nanos now, std::vector<Notice>& notices);

  /// The scene as of the last publish(), for people to look at.
  SceneDescription describe() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace hapticd::scene

// From scene commands to snapshots.
//
// For one thread: the server's scene thread applies the commands that arrived, publishes, and sleeps until
// nextDeadline() or the next command. What it publishes depends on the commands, on `now` and on the readings
// of SceneConfig::stopwatch. It starts threads that rebuild aged trees of the spatial index; they change
// which triangles are proposed as candidates, never the forces.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "scene/commands.h"
#include "scene/config.h"
#include "scene/description.h"
#include "scene/last_commands.h"
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

  /// Applies one command of a client, or queues it in the client's open batch. A command that is refused
  /// leaves the scene unchanged and appends the reason to `notices`.
  void apply(ClientId client, SceneCommand&& command, Nanos now, std::vector<Notice>& notices);

  /// The client left: drops its open batch; the forces that it owns ramp out.
  void clientGone(ClientId client, Nanos now);

  /// When publish() is due even without a command; nothing when it is not.
  std::optional<Nanos> nextDeadline() const;

  /// The oldest edit that is applied but not yet published: meshes wait for a pause between edits. Empty when
  /// all is published.
  std::optional<Nanos> oldestEdit() const;

  /// A snapshot of the scene; null when nothing changed since the last call. The first call never returns
  /// null. Builds the meshes that are due, which may take long; appends notices that became due.
  std::shared_ptr<const SceneSnapshot> publish(Nanos now, std::vector<Notice>& notices);

  /// The scene as of the last publish(), for people to look at.
  SceneDescription describe() const;

  /// Commands that make an empty scene this one, open batches included. Motions at hand begin anew; forces
  /// whose client left are not among them. In the order of their times, which let meshes be published that
  /// have been, and others when they are.
  std::vector<ClientCommand> commands(Nanos now) const;
  /// To follow a publication of commands(): new positions of vertices that are not published yet, with their
  /// times, and when they may be at the earliest.
  std::vector<ClientCommand> editsUnderWay(Nanos now) const;
  /// Of the last snapshot.
  std::uint64_t revision() const noexcept;
  /// The same, if it shows all edits up to this time.
  std::optional<std::uint64_t> revisionWith(Nanos edits) const;
  /// Those of its configuration; may be null.
  const std::shared_ptr<ForceOwners>& owners() const noexcept;
  /// How often the scene was reset; a reset in a batch counts when the batch is committed.
  std::uint64_t resets() const noexcept;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace hapticd::scene

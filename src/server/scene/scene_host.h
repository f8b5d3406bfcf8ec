// One scene with its devices: decodes and queues the commands of clients for the scene thread.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/config/config.h"
#include "server/scene/command_decoder.h"
#include "server/scene/scene_thread.h"

namespace hapticd::server {

/// Net thread, except play() and the callbacks.
class SceneHost {
 public:
  /// Posts a function to the net thread; from any thread.
  using Post = std::function<void(std::function<void()>)>;

  /// `name`: the configured name; empty for a scene that is not shared.
  SceneHost(std::uint32_t number, std::string name, SceneOnDisconnect onDisconnect,
            const LimitsConfig& limits = {})
      : number_(number), name_(std::move(name)), onDisconnect_(onDisconnect), limits_(limits) {}

  /// Number of the scene from 0, in the order of the configuration.
  std::uint32_t number() const noexcept { return number_; }
  const std::string& name() const noexcept { return name_; }
  const LimitsConfig& limits() const noexcept { return limits_; }

  /// Adds a device to the scene; before start().
  void add(SceneDevice device) {
    device.config.owners = owners_;
    devices_.push_back(std::move(device));
  }
  /// The callbacks run in the scene thread.
  void start(SceneThread::Callbacks callbacks, Post post);
  void stop();

  /// Decodes a scene message and keeps its command until flush(). False, with the reason, when it is
  /// malformed.
  bool take(scene::ClientId client, const wire::MessageReceived& message, std::string& error);
  /// Whether the open batch of the client was admitted when it began; none: it has no open batch.
  std::optional<bool> batchOf(scene::ClientId client) const {
    const auto open = batches_.find(client);
    return open == batches_.end() ? std::nullopt : std::optional(!open->second.has_value());
  }
  /// Why the open batch of the client was refused when it began.
  const std::string& refusalOfBatch(scene::ClientId client) const { return batches_.at(client).value(); }
  /// Without a refusal, it is admitted.
  void beginBatch(scene::ClientId client, std::optional<std::string> refusal) {
    batches_.try_emplace(client, std::move(refusal));
  }
  void endBatch(scene::ClientId client) { batches_.erase(client); }
  /// Queues the commands that take() kept; all of them are from this client.
  void flush(scene::ClientId client);
  /// Whether the client is too far ahead of the scene: its session must hold back further commands.
  bool full(scene::ClientId client) const { return thread_ && thread_->queue().full(client); }
  /// Bytes of commands that wait for the scene, by client.
  std::map<scene::ClientId, std::size_t> waiting() const {
    return thread_ ? thread_->queue().waiting() : std::map<scene::ClientId, std::size_t>{};
  }
  /// Calls `reached` in the net thread once all commands that the client sent so far are published; at once
  /// when they are already, so that a client never waits for the commands of others.
  void whenPublished(scene::ClientId client, std::function<void()> reached);
  /// The same once they are applied, and published as far as meshes do not wait for further edits: what does
  /// not concern meshes need not wait for them. Commands in an open batch are not applied.
  void whenApplied(scene::ClientId client, std::function<void()> reached);
  /// Applies a command of a recorded client; null: it disconnected. Any thread, between start() and stop().
  void play(scene::ClientId client, const scene::SceneCommand* command);
  /// Whether the scene is too far behind what play() got: call it later. Any thread.
  bool behindReplay() const;
  /// Ramps out the forces that the client owns, however busy the scene is. The client stays; what it commands
  /// before restoreForces() is not felt.
  void releaseForces(scene::ClientId client);
  /// What the client commands from now on is felt again.
  void restoreForces(scene::ClientId client);
  /// Ramps out the forces that the client owns, however busy the scene is. What it sent before is still
  /// applied until clientGone(), but no force of it is felt.
  void peerGone(scene::ClientId client);
  /// Ramps out the forces that the client owns, however busy the scene is. When the last client that
  /// commanded the scene disconnects, clears the scene if configured so.
  void clientGone(scene::ClientId client);
  /// Requests a description of the scene after all flushed commands; `reply` is called in the scene thread.
  void describe(std::function<void(std::shared_ptr<const scene::SceneDescription>)> reply);
  /// Calls in the scene thread with the builders, in the order in which devices were added. False before
  /// start().
  bool inspect(std::function<void(const std::vector<const scene::SceneBuilder*>&)> call);

 private:
  static constexpr scene::ClientId kReplay = 0;

  void releaseUrgently(scene::ClientId client);
  void push(SceneTask&& task, std::size_t bytes = sizeof(SceneTask));
  void pushAs(scene::ClientId client, SceneTask&& task, std::size_t bytes);

  std::uint32_t number_;
  std::string name_;
  SceneOnDisconnect onDisconnect_;
  LimitsConfig limits_;
  std::vector<SceneDevice> devices_;
  Post post_;
  std::unique_ptr<SceneThread> thread_;
  CommandDecoder decoder_;
  const std::shared_ptr<scene::ForceOwners> owners_ = std::make_shared<scene::ForceOwners>();
  std::set<scene::ClientId> commandingClients_;  // connected clients that have commanded the scene
  // Why it was refused, if it was; the builder has its content.
  std::map<scene::ClientId, std::optional<std::string>> batches_;
};

}  // namespace hapticd::server

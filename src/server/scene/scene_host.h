// One scene and the devices that touch it: commands in, one snapshot for each device out.
#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "server/config/config.h"
#include "server/scene/command_decoder.h"
#include "server/scene/scene_thread.h"

namespace hapticd::server {

/// Net thread, but for play() and the callbacks.
class SceneHost {
 public:
  /// Runs a function in the net thread, later; from any thread.
  using Post = std::function<void(std::function<void()>)>;

  /// `name` is that of the configuration; empty for the scene of one device alone.
  SceneHost(std::uint32_t number, std::string name, SceneOnDisconnect onDisconnect)
      : number_(number), name_(std::move(name)), onDisconnect_(onDisconnect) {}

  /// From 0, in the order of the configuration.
  std::uint32_t number() const noexcept { return number_; }
  const std::string& name() const noexcept { return name_; }

  /// Before start(): another device touches this scene.
  void add(SceneDevice device) { devices_.push_back(std::move(device)); }
  /// The callbacks come from the scene thread.
  void start(SceneThread::Callbacks callbacks, Post post);
  void stop();

  /// Decodes a scene message and keeps its command until flush(). False, with the reason, when it is malformed.
  bool take(scene::ClientId client, const wire::MessageReceived& message, std::string& error);
  /// Hands over the commands that take() kept, all of one client.
  void flush(scene::ClientId client);
  /// Whether the client is so far ahead of the scene that it must hold back further commands.
  bool full(scene::ClientId client) const { return thread_ && thread_->queue().full(client); }
  /// Calls, in the net thread, once everything that the client sent so far is published: at once when that is the case
  /// already, so nobody waits for the commands of others.
  void whenPublished(scene::ClientId client, std::function<void()> reached);
  /// A command of a recorded client (null: it was gone). Any thread, between start() and stop().
  void play(scene::ClientId client, const scene::SceneCommand* command);
  /// The forces that the client owns ramp out before anything that is queued is applied; the client may stay.
  void releaseForces(scene::ClientId client);
  /// What the client owns ramps out; the last client that had commanded the scene clears it, if so configured.
  void clientGone(scene::ClientId client);
  /// Asks for the scene as it is after everything that was flushed; the answer comes in the scene thread.
  void describe(std::function<void(std::shared_ptr<const scene::SceneDescription>)> answer);

 private:
  void push(SceneTask&& task, std::size_t bytes = sizeof(SceneTask));

  std::uint32_t number_;
  std::string name_;
  SceneOnDisconnect onDisconnect_;
  std::vector<SceneDevice> devices_;
  Post post_;
  std::unique_ptr<SceneThread> thread_;
  CommandDecoder decoder_;
  std::set<scene::ClientId> commandingClients_;  // clients that sent a command to the scene
};

}  // namespace hapticd::server

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

/// Net thread, but for the callbacks.
class SceneHost {
 public:
  /// `name` is that of the configuration; empty for the scene of one device alone.
  SceneHost(std::uint32_t number, std::string name, SceneOnDisconnect onDisconnect)
      : number_(number), name_(std::move(name)), onDisconnect_(onDisconnect) {}

  /// From 0, in the order of the configuration.
  std::uint32_t number() const noexcept { return number_; }
  const std::string& name() const noexcept { return name_; }

  /// Before start(): another device touches this scene.
  void add(SceneDevice device) { devices_.push_back(std::move(device)); }
  /// The callbacks come from the scene thread.
  void start(SceneThread::Callbacks callbacks);
  void stop();

  /// Gathers a message if it is a scene command.
  CommandDecoder::Outcome take(scene::ClientId client, const wire::MessageReceived& message, std::string& error);
  /// Hands the gathered commands to the scene; false when it is so far behind that reading should pause.
  bool flush();
  /// A command of a recorded client (null: it was gone). Any thread, between start() and stop().
  void play(scene::ClientId client, const scene::SceneCommand* command);
  /// What the client owns ramps out; with the last that had commanded the scene it goes, too, if so
  /// configured.
  void clientGone(scene::ClientId client);
  /// Asks for the scene as it is after all that was flushed; the answer comes in the scene thread.
  void describe(std::function<void(std::shared_ptr<const scene::SceneDescription>)> answer);

 private:
  std::uint32_t number_;
  std::string name_;
  SceneOnDisconnect onDisconnect_;
  std::vector<SceneDevice> devices_;
  std::unique_ptr<SceneThread> thread_;
  CommandDecoder decoder_;
  std::set<scene::ClientId> commanders_;  // who has said something to the scene
};

}  // namespace hapticd::server

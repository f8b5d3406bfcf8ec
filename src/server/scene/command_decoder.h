// From the wire to the scene: one overload for each message that commands it.
#pragma once

#include <vector>

#include "server/scene/scene_task.h"
#include "wire/peer.h"

namespace hapticd::server {

/// Gathers one client's commands for one scene, in order, until they are handed over. Neighbouring setVertex
/// messages become one run: an upload sends one message for each vertex. Net thread.
class CommandDecoder {
 public:
  enum class Outcome { taken, notACommand, malformed };

  /// Takes a message if it is a scene command. Malformed ones change nothing; `error` then says why.
  Outcome take(scene::ClientId client, const wire::MessageReceived& message, std::string& error);

  /// Adds something that is no message.
  void add(SceneTask&& task);

  bool empty() const noexcept { return tasks_.empty(); }
  /// About how many bytes the tasks hold.
  std::size_t bytes() const noexcept { return bytes_; }
  /// Hands the tasks over and starts anew.
  std::vector<SceneTask> release();

 private:
  void addVertex(scene::ClientId client, const wire::SetVertex& vertex);
  void addTriangle(scene::ClientId client, const wire::SetTriangle& triangle);

  std::vector<SceneTask> tasks_;
  std::size_t bytes_ = 0;
};

}  // namespace hapticd::server

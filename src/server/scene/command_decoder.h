// Decodes scene messages from the wire into scene commands.
#pragma once

#include <vector>

#include "server/scene/scene_task.h"
#include "wire/peer.h"

namespace hapticd::server {

/// Collects the commands of one client for one scene in order until release(). Consecutive setVertex messages
/// become one run, because an upload sends one message for each vertex. Net thread.
class CommandDecoder {
 public:
  enum class Outcome { taken, notACommand, malformed };

  /// Decodes a message if its role is scene. A malformed message changes nothing; `error` is then the reason.
  Outcome take(scene::ClientId client, const wire::MessageReceived& message, std::string& error);

  /// Adds a task that is not a message.
  void add(SceneTask&& task);

  bool empty() const noexcept { return tasks_.empty(); }
  /// Approximate size of the collected tasks in bytes.
  std::size_t bytes() const noexcept { return bytes_; }
  /// Returns the collected tasks and starts an empty list.
  std::vector<SceneTask> release();

 private:
  void addVertex(scene::ClientId client, const wire::SetVertex& vertex);
  void addTriangle(scene::ClientId client, const wire::SetTriangle& triangle);

  std::vector<SceneTask> tasks_;
  std::size_t bytes_ = 0;
};

}  // namespace hapticd::server

// What the net thread asks of a scene.
#pragma once

#include <functional>
#include <memory>
#include <variant>

#include "scene/commands.h"
#include "scene/description.h"
#include "scene/notice.h"

namespace hapticd::server {

/// A client left: what it owns ramps out.
struct ClientGone {};

/// Asks for a description of the scene as it is after the tasks before it. The answer comes in the scene thread.
struct DescribeScene {
  std::function<void(std::shared_ptr<const scene::SceneDescription>)> answer;
};

/// Asks for a call, in the scene thread, once everything that this client sent before is published to the servos.
struct WhenPublished {
  std::function<void()> reached;
};

/// One thing for the scene to do, from one client.
struct SceneTask {
  scene::ClientId client = 0;
  std::variant<scene::SceneCommand, ClientGone, DescribeScene, WhenPublished> what;
};

}  // namespace hapticd::server

// The tasks that the net thread gives to a scene thread.
#pragma once

#include <functional>
#include <memory>
#include <variant>
#include <vector>

#include "scene/builder.h"
#include "scene/commands.h"
#include "scene/description.h"
#include "scene/notice.h"

namespace hapticd::server {

/// The client disconnected: the forces that it owns ramp out.
struct ClientGone {};

/// The client's forces were released while it stayed: those of its commands after this one are felt again.
struct ForcesReturn {
  std::uint64_t leaves = 0;  ///< that the client asks to undo
};

/// Requests a description of the scene after the preceding tasks. `reply` is called in the scene thread; with
/// null when memory ran out.
struct DescribeScene {
  std::function<void(std::shared_ptr<const scene::SceneDescription>)> reply;
};

/// Requests a call in the scene thread once all preceding commands of this client are published to the
/// servos.
struct WhenPublished {
  std::function<void()> reached;
};

/// Requests a call in the scene thread once the preceding tasks are published, as far as meshes do not wait
/// for further edits, with the builders in the order of the devices.
struct Inspect {
  std::function<void(const std::vector<const scene::SceneBuilder*>&)> call;
};

/// One task of one client.
struct SceneTask {
  scene::ClientId client = 0;
  std::variant<scene::SceneCommand, ClientGone, ForcesReturn, DescribeScene, WhenPublished, Inspect> what;
};

}  // namespace hapticd::server

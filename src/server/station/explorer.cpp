#include "server/station/explorer.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

#include "base/world.h"
#include "server/station/scripted_hand.h"

namespace hapticd::server {

void Explorer::explore(std::shared_ptr<const scene::SceneSnapshot> scene) {
  {
    const std::lock_guard lock(mutex_);
    next_ = std::move(scene);
  }
  if (thread_.running()) {
    thread_.wake();
  } else {
    thread_ = base::Thread({.name = "explorer", .niceness = 10}, [this]() -> std::optional<base::Nanos> {
      plan();
      return std::nullopt;
    });
  }
}

void Explorer::plan() {
  std::shared_ptr<const scene::SceneSnapshot> scene;
  {
    const std::lock_guard lock(mutex_);
    scene = std::exchange(next_, nullptr);
  }
  if (!scene) return;
  try {
    hand_.setPath(
        std::make_shared<const device::WaypointPath>(planStrokes(*scene, workspace_m_, base::now(), &ended_),
                                                     device::WaypointPath::Repeat::yes, kScriptedStrength_N));
  } catch (const std::exception& error) {
    spdlog::warn(
        "device '{}': the scripted hand finds no path over this scene and keeps the previous one: {}",
        device_, error.what());
  }
}

}  // namespace hapticd::server

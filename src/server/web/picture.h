// Everything that one answer is made of, gathered in the net thread and turned into text in a worker.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/web/server_status.h"
#include "server/web/scene_watch.h"

namespace hapticd::server {

/// A scene in a picture.
struct ScenePicture {
  std::shared_ptr<const SceneView> view;      ///< null when the scene has not told yet
  std::vector<std::size_t> displayTriangles;  ///< of each object in the view
};

struct Picture {
  std::string version;
  ServerStatus server;
  std::vector<ScenePicture> scenes;
};

/// The answer of /api/state; its fields stand in docs/viewer.md.
std::string stateJson(const Picture& picture);

/// The answer of /metrics: Prometheus text format 0.0.4.
std::string metricsText(const Picture& picture);

/// The names of all messages of the wire: what the page may say and hear.
std::string messagesJson();

}  // namespace hapticd::server

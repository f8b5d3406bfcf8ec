// Everything that one HTTP response is made of: gathered on the net thread, turned into text on a worker.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/web/scene_watch.h"
#include "server/web/server_status.h"

namespace hapticd::server {

/// One scene in a StateReport.
struct SceneReport {
  std::shared_ptr<const ObservedScene> observed;  ///< null until the scene has replied for the first time
  std::vector<std::size_t> displayTriangles;      ///< of each object in `observed`
};

struct StateReport {
  std::string version;
  ServerStatus server;
  std::vector<SceneReport> scenes;
};

/// Body of /api/state. docs/viewer.md lists the fields.
std::string stateJson(const StateReport& report);

/// Body of /metrics: Prometheus text format 0.0.4.
std::string metricsText(const StateReport& report);

/// Body of /api/messages: the names of all wire messages, with direction and meaning.
std::string messagesJson();

/// Why the server is of no use now, a line for each device that does not work; empty when all work.
std::string faultsOf(const ServerStatus& status);

/// Body of an HTTP error: {"error": text}. The text may contain any bytes; what is not UTF-8 is replaced by
/// U+FFFD.
std::string errorJson(std::string_view text);

}  // namespace hapticd::server

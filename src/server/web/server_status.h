// Status of the server as plain values, for the page and for metrics.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/session/client_status.h"
#include "server/station/device_status.h"
#include "server/web/replay_status.h"

namespace hapticd::server {

struct ServerStatus {
  std::string run;  ///< another one for each start on this machine
  double uptime_s = 0;
  std::string recording;               ///< file name; empty: not recording
  std::optional<ReplayStatus> replay;  ///< empty: live
  std::vector<DeviceStatus> devices;
  std::vector<ClientStatus> clients;
  std::vector<std::vector<std::string>> scenes;  ///< per scene: first name of each of its devices
};

}  // namespace hapticd::server

// The server at one moment, as plain values: for the page and for metrics.
#pragma once

#include <string>
#include <vector>

#include "server/session/client_status.h"
#include "server/station/device_status.h"

namespace hapticd::server {

struct ServerStatus {
  double uptime_s = 0;
  std::string recording;  ///< file name; empty when nothing is being recorded
  std::vector<DeviceStatus> devices;
  std::vector<ClientStatus> clients;
  std::vector<std::vector<std::string>> scenes;  ///< first names of the devices that touch each
};

}  // namespace hapticd::server

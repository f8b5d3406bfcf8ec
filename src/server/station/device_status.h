// The state of a device and its servo loop at one moment, as plain values for the viewer and the metrics.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/histogram.h"
#include "realtime/servo/report.h"

namespace hapticd::server {

struct DeviceStatus {
  std::vector<std::string> names;
  std::string driver;
  bool simulated = false;
  std::size_t scene = 0;  ///< number of the scene in the server
  geometry::Box workspace_m;
  double peakForce_N = 0;
  double rate_Hz = 0;
  bool realtime = false;  ///< the loop has realtime scheduling
  std::string hand;       ///< what moves it: scripted, file, held (by a client), user, recorded
  std::optional<std::uint32_t> heldBy;
  std::string fault;
  std::uint64_t droppedReports = 0;
  realtime::TickReport last;
  base::Histogram::Copy period, wakeup, compute;
};

}  // namespace hapticd::server

// A replayed recording as plain values, for the page.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace hapticd::server {

/// What a recording holds along its time. Seconds since its first event.
struct TimeLine {
  double duration_s = 0;
  std::vector<std::pair<double, double>> contacts;      ///< from, to; those nearby joined
  std::vector<std::pair<double, std::string>> trips;    ///< a trip that removes the force began
  std::vector<std::pair<double, std::string>> markers;  ///< of clients
};

struct ReplayStatus {
  std::string file;
  double position_s = 0;
  double speed = 1;
  bool paused = false;
  bool ended = false;
  bool loop = false;
  std::shared_ptr<const TimeLine> timeLine;  ///< null until the file was read once
};

}  // namespace hapticd::server

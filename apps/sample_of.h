// Ticks that a client receives, as rows of CSV and JSON.
#pragma once

#include <chrono>
#include <string>

#include "hapticd/reports.h"
#include "record/sample.h"

namespace hapticd::apps {

/// Time since 1970, UTC.
inline base::Nanos nanosOf(Time time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}

/// In the frame that the server reports. Clients do not receive what the last columns hold.
inline record::Sample sampleOf(const std::string& device, const TickReport& tick) {
  const auto vec = [](const auto& v) { return geometry::Vec3(v[0], v[1], v[2]); };
  record::Sample sample;
  sample.device = device;
  sample.time_ns = nanosOf(tick.time);
  sample.tick = tick.tick;
  sample.revision = tick.revision;
  sample.hip_m = vec(tick.hand_m);
  sample.proxy_m = vec(tick.proxy_m);
  sample.velocity_m_per_s = vec(tick.velocity_m_per_s);
  const auto& q = tick.orientation;
  sample.orientation = geometry::Quat(q[3], q[0], q[1], q[2]);
  sample.force_N = vec(tick.force_N);
  sample.depth_m = tick.depth_m;
  sample.touching = tick.object >= 0 || tick.depth_m > 0;
  sample.object = tick.object;
  sample.buttons = tick.buttons;
  sample.guardActive = tick.guardActive;
  sample.guardLatched = tick.guardLatched;
  return sample;
}

}  // namespace hapticd::apps

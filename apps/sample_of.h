// Ticks that a client receives, as rows of CSV and JSON.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>
#include <string>
#include <string_view>

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

/// A sample, and the names of its fields that nobody reported.
struct PartOfSample {
  record::Sample sample;
  std::set<std::string_view> unknown;
};

/// Of the newest separate reports of a server without `hapticd Tick`.
inline PartOfSample sampleOf(const std::string& device, const LatestReports& latest) {
  PartOfSample part{.sample = {}, .unknown = {"tick", "revision"}};
  record::Sample& sample = part.sample;
  sample.device = device;
  const auto vec = [](const auto& v) { return geometry::Vec3(v[0], v[1], v[2]); };
  // Of a report that may be missing; the names are those of what only it tells.
  const auto take = [&](const auto* report, std::initializer_list<std::string_view> names, auto assign) {
    if (report == nullptr || report->time == Time()) return part.unknown.insert(names);
    sample.time_ns = std::max(sample.time_ns, nanosOf(report->time));
    assign(*report);
  };
  const auto find = [](const auto& reports, int sensor) {
    const auto found = reports.find(sensor);
    return found != reports.end() ? &found->second : nullptr;
  };
  take(find(latest.pose, 0), {"proxy_m", "orientation_xyzw"}, [&](const PoseReport& report) {
    const auto& q = report.orientation;
    sample.proxy_m = vec(report.position_m);
    sample.orientation = geometry::Quat(q[3], q[0], q[1], q[2]);
  });
  take(find(latest.pose, 1), {"hip_m"},
       [&](const PoseReport& report) { sample.hip_m = vec(report.position_m); });
  const VelocityReport* const velocity = find(latest.velocity, 1);
  take(velocity != nullptr ? velocity : find(latest.velocity, 0), {"velocity_m_per_s"},
       [&](const VelocityReport& report) { sample.velocity_m_per_s = vec(report.velocity_m_per_s); });
  take(&latest.force, {"force_N"}, [&](const ForceReport& report) { sample.force_N = vec(report.force_N); });
  take(&latest.depth, {"depth_m"}, [&](const DepthReport& report) { sample.depth_m = report.depth_m; });
  take(&latest.touching, {"touching"},
       [&](const TouchingReport& report) { sample.touching = report.touching; });
  take(&latest.touchedObject, {"object"},
       [&](const TouchedObjectReport& report) { sample.object = report.object; });
  take(&latest.guard, {"guard_active", "guard_latched"}, [&](const GuardReport& report) {
    sample.guardActive = report.active;
    sample.guardLatched = report.latched;
  });
  if (latest.pressed.empty()) part.unknown.insert("buttons");
  for (const auto& [button, pressed] : latest.pressed) {
    if (pressed && button >= 0 && button < 32) sample.buttons |= 1U << button;
  }
  if (sample.time_ns == 0) part.unknown.insert("time_ns");
  return part;
}

/// Passes the fields of a sample on to a row or an object, those that are not known as absent.
template <class Writer>
class KnownFields {
 public:
  KnownFields(Writer& writer, const std::set<std::string_view>& unknown)
      : writer_(writer), unknown_(unknown) {}

  template <class T>
  void operator()(const char* name, const T& value) {
    if (unknown_.count(name) != 0) {
      writer_(name, std::optional<T>());
    } else {
      writer_(name, value);
    }
  }
  template <class T>
  void operator()(const char* name, const std::optional<T>& value) {
    writer_(name, value);
  }

 private:
  Writer& writer_;
  const std::set<std::string_view>& unknown_;
};

}  // namespace hapticd::apps

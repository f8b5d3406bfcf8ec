#include "server/time_line.h"

#include <algorithm>
#include <optional>

#include "base/time.h"
#include "record/recording_reader.h"

namespace hapticd::server {
namespace {

constexpr std::size_t kMost = 300;

// Joins the contacts with the shortest pauses between them until few are left.
void join(std::vector<std::pair<double, double>>& spans) {
  for (double pause = 0.05; spans.size() > kMost; pause *= 2) {
    std::vector<std::pair<double, double>> joined;
    for (const auto& span : spans) {
      if (!joined.empty() && span.first - joined.back().second < pause) {
        joined.back().second = std::max(joined.back().second, span.second);
      } else {
        joined.push_back(span);
      }
    }
    spans = std::move(joined);
  }
}

struct DeviceReading {
  bool touching = false;
  std::uint32_t trips = 0;
};

}  // namespace

TimeLine readTimeLine(const std::filesystem::path& file, const std::atomic<bool>& stopping) {
  record::RecordingReader reader(file);
  TimeLine line;
  std::vector<DeviceReading> devices(reader.header().devices.size());
  std::optional<base::Nanos> origin;
  double begin = 0;  // since the first event of the file; others may be earlier
  double end = 0;
  const auto since = [&](base::Nanos time) {
    if (!origin) origin = time;
    const double at = base::toSeconds(time - *origin);
    begin = std::min(begin, at);
    end = std::max(end, at);
    return at;
  };
  for (record::RecordingEvent event; !stopping && reader.next(event);) {
    if (const auto* scene = std::get_if<record::SceneEvent>(&event)) since(scene->time);
    if (const auto* marker = std::get_if<record::MarkerEvent>(&event)) {
      const double at = since(marker->time);
      if (line.markers.size() < kMost) line.markers.emplace_back(at, marker->text);
    }
    const auto* tick = std::get_if<record::TickEvent>(&event);
    if (tick == nullptr) continue;
    const realtime::TickReport& report = tick->tick.report;
    const double at = since(report.time);
    DeviceReading& device = devices[tick->device];
    if (report.rendering.touching) {
      if (!device.touching) line.contacts.emplace_back(at, at);
      if (!line.contacts.empty()) line.contacts.back().second = at;
    }
    device.touching = report.rendering.touching;
    const std::uint32_t holds =
        (report.guard.active | report.guard.latched) & ~realtime::tripsOf(realtime::TripAction::clamp);
    for (const realtime::TripInfo& trip : realtime::kTrips) {
      if ((holds & ~device.trips & realtime::bit(trip.trip)) != 0 && line.trips.size() < kMost)
        line.trips.emplace_back(at, trip.name);
    }
    device.trips = holds;
  }
  std::sort(line.contacts.begin(), line.contacts.end());
  join(line.contacts);
  line.duration_s = end - begin;
  for (auto& marker : line.markers) marker.first -= begin;
  for (auto& trip : line.trips) trip.first -= begin;
  for (auto& [from, to] : line.contacts) {
    from -= begin;
    to -= begin;
  }
  return line;
}

}  // namespace hapticd::server

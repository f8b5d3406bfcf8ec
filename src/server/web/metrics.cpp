#include "server/web/picture.h"
#include "server/web/process.h"
#include "server/web/prometheus_text.h"

namespace hapticd::server {
namespace {

using Text = PrometheusText;

// One family with a sample for each device.
template <class Value>
void ofDevices(Text& out, const Picture& picture, std::string_view name, std::string_view type,
               std::string_view help, const Value& value) {
  out.family(name, type, help);
  for (const DeviceStatus& device : picture.server.devices) {
    out.sample(static_cast<double>(value(device)), {{"device", device.names.front()}});
  }
}

void loops(Text& out, const Picture& picture) {
  const auto histograms = [&](std::string_view name, std::string_view help,
                              const realtime::Histogram::Copy DeviceStatus::*which) {
    out.family(name, "histogram", help);
    for (const DeviceStatus& device : picture.server.devices) {
      out.histogram(device.*which, device.names.front());
    }
  };
  histograms("hapticd_tick_period_seconds", "Time from the start of one tick to the next.",
             &DeviceStatus::period);
  histograms("hapticd_tick_wakeup_error_seconds", "Start of a tick less its deadline.",
             &DeviceStatus::wakeup);
  histograms("hapticd_tick_compute_seconds", "Time from the start of a tick until its force was written.",
             &DeviceStatus::compute);
  ofDevices(out, picture, "hapticd_ticks_total", "counter", "Turns of the servo loop.",
            [](const auto& d) { return d.last.tick; });
  ofDevices(out, picture, "hapticd_tick_overruns_total", "counter",
            "Ticks that were not done when the next was due.",
            [](const auto& d) { return d.last.timing.overruns; });
  ofDevices(out, picture, "hapticd_tick_skipped_periods_total", "counter",
            "Periods without a tick because one before took too long.",
            [](const auto& d) { return d.last.timing.skippedPeriods; });
  ofDevices(out, picture, "hapticd_reports_dropped_total", "counter",
            "Reports of ticks that found the way to the network full.",
            [](const auto& d) { return d.droppedReports; });
  ofDevices(out, picture, "hapticd_loop_rate_hertz", "gauge", "Nominal rate of the servo loop.",
            [](const auto& d) { return d.rate_Hz; });
  ofDevices(out, picture, "hapticd_loop_realtime", "gauge", "1 when the loop has realtime scheduling.",
            [](const auto& d) { return d.realtime ? 1 : 0; });
}

void forces(Text& out, const Picture& picture) {
  ofDevices(out, picture, "hapticd_force_newtons", "gauge", "Force written to the device in the last tick.",
            [](const auto& d) { return d.last.force_N.norm(); });
  ofDevices(out, picture, "hapticd_force_limit_newtons", "gauge",
            "Peak force of the device less what its thermal budget takes.",
            [](const auto& d) { return d.last.guard.limit_N; });
  ofDevices(out, picture, "hapticd_force_saturation_ratio", "gauge", "Force of the last tick over its limit.",
            [](const auto& d) {
              return d.last.guard.limit_N > 0 ? d.last.force_N.norm() / d.last.guard.limit_N : 0;
            });
  ofDevices(out, picture, "hapticd_touching", "gauge", "1 while the hand touches something.",
            [](const auto& d) { return d.last.rendering.touching ? 1 : 0; });
  ofDevices(out, picture, "hapticd_motor_heat_ratio", "gauge", "Worst motor: 0 is cold, 1 is hot.",
            [](const auto& d) { return d.last.device.motorTemperature; });
  ofDevices(out, picture, "hapticd_guard_armed", "gauge", "1 when forces are enabled and not stopped.",
            [](const auto& d) { return d.last.guard.armed && !d.last.guard.stopped ? 1 : 0; });
}

void trips(Text& out, const Picture& picture) {
  const auto family = [&](std::string_view name, std::string_view type, std::string_view help,
                          const auto& value) {
    out.family(name, type, help);
    for (const DeviceStatus& device : picture.server.devices) {
      for (const realtime::TripInfo& trip : realtime::kTrips) {
        out.sample(value(device.last.guard, trip.trip),
                   {{"device", device.names.front()}, {"trip", trip.name}});
      }
    }
  };
  family("hapticd_guard_trips_total", "counter", "How often the guard began to act, by what it objected to.",
         [](const realtime::GuardReport& guard, realtime::Trip trip) -> double {
           return guard.counts[static_cast<std::size_t>(trip)];
         });
  family("hapticd_guard_active", "gauge", "1 while the guard acts or waits to be re-armed.",
         [](const realtime::GuardReport& guard, realtime::Trip trip) -> double {
           return ((guard.active | guard.latched) & realtime::bit(trip)) != 0 ? 1 : 0;
         });
}

template <class Value>
void ofClients(Text& out, const Picture& picture, std::string_view name, std::string_view type,
               std::string_view help, const Value& value) {
  out.family(name, type, help);
  for (const ClientStatus& client : picture.server.clients) {
    out.sample(static_cast<double>(value(client)),
               {{"client", std::to_string(client.id)}, {"address", client.address}, {"mode", client.mode}});
  }
}

void clients(Text& out, const Picture& picture) {
  out.family("hapticd_clients", "gauge", "Clients connected now.");
  out.sample(static_cast<double>(picture.server.clients.size()));
  ofClients(out, picture, "hapticd_client_received_bytes_total", "counter", "Bytes from the client.",
            [](const auto& c) { return c.bytesIn; });
  ofClients(out, picture, "hapticd_client_sent_bytes_total", "counter", "Bytes handed to the system for it.",
            [](const auto& c) { return c.bytesOut; });
  ofClients(out, picture, "hapticd_client_report_rate_hertz", "gauge", "Reports a second that it chose.",
            [](const auto& c) { return c.rate_Hz; });
  ofClients(out, picture, "hapticd_client_lag_bytes", "gauge",
            "Bytes on their way that it has not acknowledged, here and in the system.",
            [](const auto& c) { return c.queuedBytes + c.unacknowledgedBytes; });
  ofClients(out, picture, "hapticd_client_dropped_total", "counter",
            "Late reports that were dropped because it reads too slowly.",
            [](const auto& c) { return c.dropped; });
}

template <class Value>
void ofScenes(Text& out, const Picture& picture, std::string_view name, std::string_view type,
              std::string_view help, const Value& value) {
  out.family(name, type, help);
  for (std::size_t i = 0; i < picture.scenes.size(); ++i) {
    if (!picture.scenes[i].view) continue;
    const std::string number = std::to_string(i);
    out.sample(static_cast<double>(value(*picture.scenes[i].view->description)), {{"scene", number}});
  }
}

void scenes(Text& out, const Picture& picture) {
  using Scene = scene::SceneDescription;
  ofScenes(out, picture, "hapticd_scene_changes_total", "counter",
           "Changes of the scene that were published.", [](const Scene& s) { return s.revision; });
  ofScenes(out, picture, "hapticd_scene_objects", "gauge", "Objects in the scene.",
           [](const Scene& s) { return s.objects.size(); });
  ofScenes(out, picture, "hapticd_scene_vertices", "gauge", "Vertices of all objects.", [](const Scene& s) {
    std::size_t sum = 0;
    for (const auto& object : s.objects) sum += object.vertices ? object.vertices->size() : 0;
    return sum;
  });
  ofScenes(out, picture, "hapticd_scene_triangles", "gauge", "Triangles of all objects.", [](const Scene& s) {
    std::size_t sum = 0;
    for (const auto& object : s.objects) sum += object.triangles ? object.triangles->size() : 0;
    return sum;
  });
  ofScenes(out, picture, "hapticd_scene_effects", "gauge", "Effects that run.", [](const Scene& s) {
    std::size_t running = 0;
    for (const auto& effect : s.effects) running += effect.active ? 1 : 0;
    return running;
  });
}

void process(Text& out, const Picture& picture) {
  const ProcessUsage usage = processUsage();
  const auto one = [&out](std::string_view name, std::string_view type, std::string_view help, auto value) {
    out.family(name, type, help);
    out.sample(static_cast<double>(value));
  };
  one("hapticd_uptime_seconds", "gauge", "Time since the server started.", picture.server.uptime_s);
  one("process_resident_memory_bytes", "gauge", "Memory in use.", usage.residentBytes);
  one("process_virtual_memory_bytes", "gauge", "Addresses in use.", usage.virtualBytes);
  one("process_open_fds", "gauge", "Open files and sockets.", usage.openFiles);
  one("process_cpu_seconds_total", "counter", "Processor time of all threads.", usage.cpu_s);
}

}  // namespace

std::string metricsText(const Picture& picture) {
  Text out;
  out.family("hapticd_build_info", "gauge", "1, with the version of the server.");
  out.sample(1, {{"version", picture.version}});
  loops(out, picture);
  forces(out, picture);
  trips(out, picture);
  clients(out, picture);
  scenes(out, picture);
  process(out, picture);
  return out.text();
}

}  // namespace hapticd::server

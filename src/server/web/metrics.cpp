#include "server/web/process.h"
#include "server/web/prometheus_text.h"
#include "server/web/state_report.h"

namespace hapticd::server {
namespace {

using Text = PrometheusText;

// One family with a sample for each device.
template <class Value>
void ofDevices(Text& out, const StateReport& report, std::string_view name, std::string_view type,
               std::string_view help, const Value& value) {
  out.family(name, type, help);
  for (const DeviceStatus& device : report.server.devices) {
    out.sample(static_cast<double>(value(device)), {{"device", device.names.front()}});
  }
}

void loops(Text& out, const StateReport& report) {
  const auto histograms = [&](std::string_view name, std::string_view help,
                              const base::Histogram::Copy DeviceStatus::*which) {
    out.family(name, "histogram", help);
    for (const DeviceStatus& device : report.server.devices) {
      out.histogram(device.*which, device.names.front());
    }
  };
  histograms("hapticd_tick_period_seconds", "Time from the start of one tick to the next.",
             &DeviceStatus::period);
  histograms("hapticd_tick_wakeup_error_seconds", "Start of a tick less its deadline.",
             &DeviceStatus::wakeup);
  histograms("hapticd_tick_compute_seconds", "Time from the start of a tick until its force was written.",
             &DeviceStatus::compute);
  ofDevices(out, report, "hapticd_ticks_total", "counter", "Ticks of the servo loop.",
            [](const auto& d) { return d.last.tick; });
  ofDevices(out, report, "hapticd_tick_overruns_total", "counter",
            "Ticks more than 0.5 ms late, or lost to a long tick before.",
            [](const auto& d) { return d.last.timing.overruns; });
  ofDevices(out, report, "hapticd_tick_skipped_periods_total", "counter",
            "Periods without a tick because an earlier tick took too long.",
            [](const auto& d) { return d.last.timing.skippedPeriods; });
  ofDevices(out, report, "hapticd_reports_dropped_total", "counter",
            "Tick reports dropped because the queue to the network thread was full.",
            [](const auto& d) { return d.droppedReports; });
  ofDevices(out, report, "hapticd_loop_rate_hertz", "gauge", "Nominal rate of the servo loop.",
            [](const auto& d) { return d.rate_Hz; });
  ofDevices(out, report, "hapticd_loop_realtime", "gauge", "1 when the loop has realtime scheduling.",
            [](const auto& d) { return d.realtime ? 1 : 0; });
}

void forces(Text& out, const StateReport& report) {
  ofDevices(out, report, "hapticd_force_newtons", "gauge", "Force written to the device in the last tick.",
            [](const auto& d) { return d.last.force_N.norm(); });
  ofDevices(out, report, "hapticd_force_limit_newtons", "gauge",
            "Peak force of the device, reduced by its thermal budget.",
            [](const auto& d) { return d.last.guard.limit_N; });
  ofDevices(out, report, "hapticd_force_saturation_ratio", "gauge",
            "Force of the last tick divided by its limit.", [](const auto& d) {
              return d.last.guard.limit_N > 0 ? d.last.force_N.norm() / d.last.guard.limit_N : 0;
            });
  ofDevices(out, report, "hapticd_touching", "gauge", "1 while the tool touches something.",
            [](const auto& d) { return d.last.rendering.touching ? 1 : 0; });
  ofDevices(out, report, "hapticd_motor_heat_ratio", "gauge", "Hottest motor: 0 is cold, 1 is its limit.",
            [](const auto& d) { return d.last.device.motorTemperature; });
  ofDevices(out, report, "hapticd_guard_armed", "gauge", "1 when forces are enabled and not stopped.",
            [](const auto& d) { return d.last.guard.armed && !d.last.guard.stopped ? 1 : 0; });
}

void trips(Text& out, const StateReport& report) {
  const auto family = [&](std::string_view name, std::string_view type, std::string_view help,
                          const auto& value) {
    out.family(name, type, help);
    for (const DeviceStatus& device : report.server.devices) {
      for (const realtime::TripInfo& trip : realtime::kTrips) {
        out.sample(value(device.last.guard, trip.trip),
                   {{"device", device.names.front()}, {"trip", trip.name}});
      }
    }
  };
  family("hapticd_guard_trips_total", "counter", "How often each trip of the guard began.",
         [](const realtime::GuardReport& guard, realtime::Trip trip) -> double {
           return guard.counts[static_cast<std::size_t>(trip)];
         });
  family("hapticd_guard_active", "gauge", "1 while the trip is active or latched.",
         [](const realtime::GuardReport& guard, realtime::Trip trip) -> double {
           return ((guard.active | guard.latched) & realtime::bit(trip)) != 0 ? 1 : 0;
         });
}

template <class Value>
void ofClients(Text& out, const StateReport& report, std::string_view name, std::string_view type,
               std::string_view help, const Value& value) {
  out.family(name, type, help);
  for (const ClientStatus& client : report.server.clients) {
    out.sample(static_cast<double>(value(client)),
               {{"client", std::to_string(client.id)}, {"address", client.address}, {"mode", client.mode}});
  }
}

void clients(Text& out, const StateReport& report) {
  out.family("hapticd_clients", "gauge", "Clients connected now.");
  out.sample(static_cast<double>(report.server.clients.size()));
  ofClients(out, report, "hapticd_client_received_bytes_total", "counter", "Bytes received from the client.",
            [](const auto& c) { return c.bytesIn; });
  ofClients(out, report, "hapticd_client_sent_bytes_total", "counter",
            "Bytes handed to the operating system for the client.", [](const auto& c) { return c.bytesOut; });
  ofClients(out, report, "hapticd_client_report_rate_hertz", "gauge",
            "Report rate that the client requested.", [](const auto& c) { return c.rate_Hz; });
  ofClients(out, report, "hapticd_client_lag_bytes", "gauge",
            "Bytes queued in the server or the operating system that the client has not acknowledged.",
            [](const auto& c) { return c.queuedBytes + c.unacknowledgedBytes; });
  ofClients(out, report, "hapticd_client_dropped_total", "counter",
            "Batches of reports that were not sent: the client reads too slowly, or the server was behind.",
            [](const auto& c) { return c.dropped; });
}

template <class Value>
void ofScenes(Text& out, const StateReport& report, std::string_view name, std::string_view type,
              std::string_view help, const Value& value) {
  out.family(name, type, help);
  for (std::size_t i = 0; i < report.scenes.size(); ++i) {
    if (!report.scenes[i].observed) continue;
    const std::string number = std::to_string(i);
    out.sample(static_cast<double>(value(*report.scenes[i].observed->description)), {{"scene", number}});
  }
}

void scenes(Text& out, const StateReport& report) {
  using Scene = scene::SceneDescription;
  ofScenes(out, report, "hapticd_scene_changes_total", "counter", "Published changes of the scene.",
           [](const Scene& s) { return s.revision; });
  ofScenes(out, report, "hapticd_scene_objects", "gauge", "Objects in the scene.",
           [](const Scene& s) { return s.objects.size(); });
  ofScenes(out, report, "hapticd_scene_vertices", "gauge", "Vertices of all objects.", [](const Scene& s) {
    std::size_t sum = 0;
    for (const auto& object : s.objects) sum += object.vertices ? object.vertices->size() : 0;
    return sum;
  });
  ofScenes(out, report, "hapticd_scene_triangles", "gauge", "Triangles of all objects.", [](const Scene& s) {
    std::size_t sum = 0;
    for (const auto& object : s.objects) sum += object.triangles ? object.triangles->size() : 0;
    return sum;
  });
  ofScenes(out, report, "hapticd_scene_effects", "gauge", "Active effects.", [](const Scene& s) {
    std::size_t running = 0;
    for (const auto& effect : s.effects) running += effect.active ? 1 : 0;
    return running;
  });
}

void process(Text& out, const StateReport& report) {
  const ProcessUsage usage = processUsage();
  const auto one = [&out](std::string_view name, std::string_view type, std::string_view help, auto value) {
    out.family(name, type, help);
    out.sample(static_cast<double>(value));
  };
  one("hapticd_uptime_seconds", "gauge", "Time since the server started.", report.server.uptime_s);
  one("process_resident_memory_bytes", "gauge", "Resident memory.", usage.residentBytes);
  one("process_virtual_memory_bytes", "gauge", "Virtual memory.", usage.virtualBytes);
  one("process_open_fds", "gauge", "Open file descriptors.", usage.openFiles);
  one("process_cpu_seconds_total", "counter", "User and system processor time of all threads.", usage.cpu_s);
}

}  // namespace

std::string metricsText(const StateReport& report) {
  Text out;
  out.family("hapticd_build_info", "gauge", "Always 1; the label is the version of the server.");
  out.sample(1, {{"version", report.version}});
  loops(out, report);
  forces(out, report);
  trips(out, report);
  clients(out, report);
  scenes(out, report);
  process(out, report);
  return out.text();
}

}  // namespace hapticd::server

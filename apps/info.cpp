// hapticd info: what a recording holds: devices, times, forces, commands, and the configuration of its
// server.
#include <ctime>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "base/printable.h"
#include "base/time.h"
#include "commands.h"
#include "record/recording_reader.h"
#include "record/sidecar.h"

namespace hapticd::apps {
namespace {

struct DeviceFacts {
  std::uint64_t ticks = 0;
  std::uint64_t inContact = 0;
  std::uint64_t lost = 0;
  double peakForce_N = 0;
  double deepest_m = 0;
  std::map<realtime::Trip, base::Nanos> trips;  // that acted, and when each began to
};

struct RecordingFacts {
  std::vector<DeviceFacts> devices;
  std::map<std::string, std::uint64_t> commands;  // by name
  std::vector<record::MarkerEvent> markers;
  base::Nanos first = 0;
  base::Nanos last = 0;
};

void add(RecordingFacts& facts, const record::TickEvent& event) {
  const realtime::TickReport& report = event.tick.report;
  // Of several devices, those of one are read before the earlier ones of the next.
  if (facts.first == 0 || report.time < facts.first) facts.first = report.time;
  facts.last = std::max(facts.last, report.time);
  DeviceFacts& device = facts.devices.at(event.device);
  ++device.ticks;
  device.inContact += report.rendering.touching ? 1 : 0;
  device.peakForce_N = std::max(device.peakForce_N, report.force_N.norm());
  if (report.rendering.touching) device.deepest_m = std::max(device.deepest_m, report.rendering.depth_m);
  for (const realtime::TripInfo& trip : realtime::kTrips) {
    if ((report.guard.active >> static_cast<unsigned>(trip.trip) & 1U) != 0)
      device.trips.try_emplace(trip.trip, report.time);
  }
}

void add(RecordingFacts& facts, const record::SceneEvent& event) {
  if (!event.command) return;
  ++facts.commands[std::visit(
      [](const auto& command) { return std::string(std::decay_t<decltype(command)>::kInfo.name); },
      *event.command)];
}

RecordingFacts factsOf(record::RecordingReader& reader) {
  RecordingFacts facts;
  facts.devices.resize(reader.header().devices.size());
  for (record::RecordingEvent event; reader.next(event);) {
    if (const auto* tick = std::get_if<record::TickEvent>(&event)) add(facts, *tick);
    if (const auto* scene = std::get_if<record::SceneEvent>(&event)) add(facts, *scene);
    if (const auto* marker = std::get_if<record::MarkerEvent>(&event)) facts.markers.push_back(*marker);
    const auto* lost = std::get_if<record::LostEvent>(&event);
    if (lost != nullptr && lost->what == record::LostEvent::What::ticks)
      facts.devices.at(lost->device).lost += lost->count;
  }
  return facts;
}

std::string dateText(base::Nanos wall) {
  const std::time_t seconds = wall / 1'000'000'000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char text[40];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

void print(const DeviceFacts& facts, const record::RecordedDevice& device, base::Nanos first) {
  std::string names;
  for (const std::string& name : device.names) names += (names.empty() ? "" : ", ") + base::printable(name);
  std::printf("device      %s: %s (%s), scene %u, %g ticks per second\n", names.c_str(),
              base::printable(device.model).c_str(), base::printable(device.driver).c_str(), device.scene,
              device.tick.rate_Hz);
  const auto count = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  const double part =
      facts.ticks > 0 ? 100.0 * static_cast<double>(facts.inContact) / static_cast<double>(facts.ticks) : 0;
  std::printf("  ticks     %llu, %llu lost, %.1f %% in contact\n", count(facts.ticks), count(facts.lost),
              part);
  std::printf("  force     at most %.3f N, depth at most %.3f mm\n", facts.peakForce_N,
              1e3 * facts.deepest_m);
  std::string trips;
  for (const realtime::TripInfo& trip : realtime::kTrips) {
    const auto acted = facts.trips.find(trip.trip);
    if (acted == facts.trips.end()) continue;
    char text[64];
    std::snprintf(text, sizeof text, " first at %.3f s", base::toSeconds(acted->second - first));
    trips += (trips.empty() ? "" : ", ") + std::string(trip.name) + text;
  }
  std::printf("  guard     %s\n", trips.empty() ? "never acted" : trips.c_str());
}

// The configuration, line by line.
void printConfig(std::string_view config) {
  std::putchar('\n');
  while (!config.empty()) {
    const std::string_view line = config.substr(0, config.find('\n'));
    std::printf("%s\n", base::printable(line).c_str());
    config.remove_prefix(std::min(line.size() + 1, config.size()));
  }
}

int run(const std::string& file, bool config, bool json) {
  if (json) {
    const record::Sidecar sidecar = record::sidecarOf(file);
    std::fputs(sidecar.json.c_str(), stdout);
    return statusFor(sidecar.remark);
  }
  record::RecordingReader reader(file);
  const record::RecordingHeader& header = reader.header();
  const RecordingFacts facts = factsOf(reader);
  std::printf("recording   %s\n", file.c_str());
  std::printf("written by  %s, force law %u\n", base::printable(header.program).c_str(), header.law.number);
  std::printf("began       %s\n", facts.first == 0
                                      ? "without a tick"
                                      : dateText(facts.first + reader.wallOffsetAt(facts.first)).c_str());
  std::printf("lasts       %.3f s\n", base::toSeconds(facts.last - facts.first));
  for (std::size_t i = 0; i < facts.devices.size(); ++i)
    print(facts.devices[i], header.devices[i], facts.first);
  for (const auto& [name, count] : facts.commands)
    std::printf("command     %s, %llu times\n", name.c_str(), static_cast<unsigned long long>(count));
  for (const record::MarkerEvent& marker : facts.markers)
    std::printf("marker      %.3f s: %s\n", base::toSeconds(marker.time - facts.first),
                base::printable(marker.text).c_str());
  if (config) printConfig(header.config);
  if (!reader.remark().empty()) std::fprintf(stderr, "hapticd: %s\n", reader.remark().c_str());
  return statusFor(reader.remark());
}

}  // namespace

void addInfo(CLI::App& app) {
  struct Options {
    std::string file;
    bool config = false;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("info", "Show what a recording holds: devices, time, forces, commands");
  command->add_option("file", options->file, "Recording of 'hapticd serve --record'")
      ->required()
      ->check(existingFile());
  command->add_flag("--config", options->config, "Also print the configuration of its server, as TOML");
  command->add_flag("--json", options->json,
                    "One JSON object for programs: devices, surfaces, markers, configuration");
  command->callback([options] { exitCode = run(options->file, options->config, options->json); });
}

}  // namespace hapticd::apps

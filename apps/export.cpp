// hapticd export: converts a recording for other programs.
#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "base/time.h"
#include "commands.h"
#include "print_json.h"
#include "record/export.h"
#include "record/recording_reader.h"
#include "record/sidecar.h"
#include "record/vrpn_log.h"
#include "server/player.h"
#include "server/reports/reporter.h"
#include "stop_signals.h"

namespace hapticd::apps {
namespace {

struct ExportOptions {
  std::string recording;
  std::string to;
  std::string out;
  bool force = false;
  bool json = false;
};

// Reports of one device, as a client with the default subscription receives them.
struct ReportedDevice {
  server::Reporter reporter;
  std::vector<wire::LocalSender> names;
  bool first = true;
};

wire::Time stamp(base::Nanos wall_ns) {
  return {static_cast<std::uint32_t>(wall_ns / 1'000'000'000),
          static_cast<std::uint32_t>(wall_ns % 1'000'000'000 / 1000)};
}

void addReports(ReportedDevice& device, const realtime::TickReport& tick, wire::Time time,
                record::VrpnLog& log) {
  server::ReportFrame frame;
  frame.buttons = tick.device.buttons;
  std::vector<server::Outgoing> messages;
  if (std::exchange(device.first, false)) {
    device.reporter.presentState(tick, frame, messages);
  } else {
    device.reporter.update(tick, frame, messages);
  }
  for (const server::Outgoing& out : messages) {
    for (const wire::LocalSender name : device.names) log.add(time, name, out.message);
  }
}

void exportVrpn(const ExportOptions& options, std::string& remark) {
  record::RecordingReader reader(options.recording);
  const record::RecordingHeader& header = reader.header();
  const server::ServerConfig config = server::recordedConfig(header, options.recording);
  record::VrpnLog log(options.out, record::Unfinished::dropped);
  std::vector<ReportedDevice> devices;
  for (std::size_t i = 0; i < header.devices.size(); ++i) {
    const server::DeviceConfig& device = config.devices[i];
    devices.push_back(
        {.reporter = server::Reporter(device, header.devices[i].buttons, server::defaultChoice(device)),
         .names = {}});
    for (const std::string& name : device.names) devices.back().names.push_back(log.addSender(name));
  }
  for (record::RecordingEvent event; reader.next(event);) {
    throwIfStopped();
    if (const auto* tick = std::get_if<record::TickEvent>(&event)) {
      const realtime::TickReport& report = tick->tick.report;
      addReports(devices[tick->device], report, stamp(report.time + reader.wallOffsetAt(report.time)), log);
    } else if (const auto* marker = std::get_if<record::MarkerEvent>(&event)) {
      const wire::Time time = stamp(marker->time + reader.wallOffsetAt(marker->time));
      for (const ReportedDevice& device : devices) {
        for (const wire::LocalSender name : device.names)
          log.add(time, name, wire::Marker{.time = marker->time, .text = marker->text});
      }
    }
  }
  log.close();
  remark = reader.remark();
}

// The name of the pipe, terminal or device behind "-". Into a file, the shell's redirection would write over
// or into what is there, and without the one beside it.
std::string standardOutput(bool json) {
  const std::string out = "/dev/stdout";
  if (json)
    throw std::runtime_error("--json and '-o -' both write to standard output: leave one of them out");
  std::error_code none;
  if (std::filesystem::is_regular_file(out, none))
    throw std::runtime_error("'-o -' is for pipes, and standard output is a file: name it by -o FILE");
  const int mode = ::fcntl(STDOUT_FILENO, F_GETFL);
  if (mode < 0 || (mode & O_ACCMODE) == O_RDONLY) throw std::runtime_error(kNotWritten);
  return out;
}

int run(ExportOptions options) {
  const StopSignals signals;
  if (options.out == "-") options.out = standardOutput(options.json);
  keepFile(options.out, options.force, options.recording);
  std::error_code none;
  const auto out = std::filesystem::status(options.out, none);
  const bool streams = std::filesystem::exists(out) && !std::filesystem::is_regular_file(out);
  const std::string beside = options.to == "vrpn" || streams ? "" : options.out + ".json";
  keepFile(beside, options.force, options.recording);
  constexpr auto kDropped = record::Unfinished::dropped;
  std::string remark;
  if (options.to == "vrpn") {
    exportVrpn(options, remark);
  } else {
    std::optional<record::ExportFile> besideFile;
    if (!beside.empty()) {
      besideFile.emplace(beside, kDropped);
      besideFile->write(record::sidecarOf(options.recording, throwIfStopped).json);
      besideFile->flush();
    }
    if (options.to == "csv") {
      record::CsvFile file(options.out, kDropped);
      record::exportRecording(options.recording, file, remark, throwIfStopped);
    } else {
      record::McapFile file(options.out, kDropped);
      record::exportRecording(options.recording, file, remark, throwIfStopped);
    }
    if (besideFile) besideFile->close();
  }
  if (!remark.empty()) std::fprintf(stderr, "hapticd: %s\n", remark.c_str());
  if (options.json) {
    printJson({{"recording", options.recording},
               {"out", options.out},
               {"to", options.to},
               {"beside", beside.empty() ? nlohmann::json() : nlohmann::json(beside)},
               {"remark", remark}});
  } else {
    std::fprintf(streams ? stderr : stdout, "wrote %s%s\n", options.out.c_str(),
                 beside.empty() ? "" : (" and " + beside).c_str());
  }
  return statusFor(remark);
}

}  // namespace

void addExport(CLI::App& app) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* command = app.add_subcommand("export", "Convert a recording to MCAP, CSV or a VRPN log");
  command->add_option("file", options->recording, "Recording of 'hapticd serve --record'")
      ->required()
      ->check(existingFile());
  command->add_option("--to", options->to, "mcap, csv or vrpn")
      ->required()
      ->check(CLI::IsMember({"mcap", "csv", "vrpn"}));
  command->add_option("-o,--out", options->out, "File to write; - for standard output, into a pipe")
      ->required();
  command->add_flag("--force", options->force, kForceText);
  command->add_flag("--json", options->json, kJsonText);
  command->footer(
      "mcap  ticks, poses, guard, scene commands and markers, for Foxglove and other readers of MCAP\n"
      "csv   one row for each tick of each device; --hand of 'hapticd serve' and 'hapticd render' reads it\n"
      "vrpn  the reports and markers that a client would have received; VRPN clients open it as "
      "Phantom@file:///path/to/the.vrpn\n"
      "mcap and csv come with OUT.json, where OUT is no pipe or device: program, devices, configuration, "
      "surfaces, markers.\n"
      "Example: hapticd export my.haptics --to mcap -o my.mcap");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

// hapticd export: a session file in formats of other programs.
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include "base/time.h"
#include "commands.h"
#include "record/export.h"
#include "record/recording_reader.h"
#include "record/vrpn_log.h"
#include "server/reports/reporter.h"

namespace hapticd::apps {
namespace {

struct Options {
  std::string session;
  std::string to;
  std::string out;
};

// What a client with the usual choice of reports would have heard of one device.
struct Voice {
  server::Reporter reporter;
  std::vector<wire::LocalSender> names;
  bool first = true;
};

wire::Time stamp(base::Nanos wall_ns) {
  return {static_cast<std::uint32_t>(wall_ns / 1'000'000'000),
          static_cast<std::uint32_t>(wall_ns % 1'000'000'000 / 1000)};
}

void say(Voice& voice, const realtime::TickReport& tick, wire::Time time, record::VrpnLog& log) {
  server::ReportFrame frame;
  frame.buttons = tick.device.buttons;
  std::vector<server::Outgoing> messages;
  if (std::exchange(voice.first, false)) {
    voice.reporter.presentState(tick, frame, messages);
  } else {
    voice.reporter.update(tick, frame, messages);
  }
  for (const server::Outgoing& out : messages) {
    for (const wire::LocalSender name : voice.names) log.add(time, name, out.message);
  }
}

void exportVrpn(const Options& options, std::string& remark) {
  record::RecordingReader reader(options.session);
  const record::RecordingHeader& header = reader.header();
  const server::ServerConfig config = server::parseConfig(header.config, options.session);
  record::VrpnLog log(options.out);
  std::vector<Voice> voices;
  for (std::size_t i = 0; i < header.devices.size(); ++i) {
    const server::DeviceConfig& device = config.devices.at(i);
    voices.push_back(
        {.reporter = server::Reporter(device, header.devices[i].buttons,
                                      {.kinds = wire::kReportDefault, .rate_Hz = device.reportRate_Hz}),
         .names = {}});
    for (const std::string& name : device.names) voices.back().names.push_back(log.addSender(name));
  }
  for (record::RecordingEvent event; reader.next(event);) {
    const auto* tick = std::get_if<record::TickEvent>(&event);
    if (tick == nullptr) continue;
    const realtime::TickReport& report = tick->tick.report;
    say(voices[tick->device], report, stamp(report.time + header.wallOffset), log);
  }
  log.close();
  remark = reader.remark();
}

int run(const Options& options) {
  std::string remark;
  if (options.to == "vrpn") {
    exportVrpn(options, remark);
  } else if (options.to == "csv") {
    record::CsvFile file(options.out);
    record::exportSession(options.session, file, remark);
  } else {
    record::McapFile file(options.out);
    record::exportSession(options.session, file, remark);
  }
  if (!remark.empty()) std::fprintf(stderr, "hapticd: %s\n", remark.c_str());
  return 0;
}

}  // namespace

void addExport(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("export", "Turn a session file into MCAP, CSV or a log of VRPN");
  command->add_option("file", options->session, "Session file of 'hapticd serve --record'")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("--to", options->to, "mcap, csv or vrpn")
      ->required()
      ->check(CLI::IsMember({"mcap", "csv", "vrpn"}));
  command->add_option("-o,--out", options->out, "File to write")->required();
  command->footer(
      "mcap  ticks, poses, guard and scene commands, for Foxglove and other readers of MCAP\n"
      "csv   one row for each tick of each device\n"
      "vrpn  what a client would have heard; VRPN's clients open it as Phantom@file:///path/to/the.vrpn\n"
      "Example: hapticd export my.haptics --to mcap -o my.mcap");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

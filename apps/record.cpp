// hapticd record: writes the reports that a client receives to a file; sends no commands.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "base/time.h"
#include "commands.h"
#include "hapticd/client.h"
#include "record/export.h"
#include "record/vrpn_log.h"
#include "sample_of.h"
#include "stop_signals.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

struct RecordOptions {
  std::string server;
  std::string file;
  double seconds = 0;
  double rate_Hz = 1000;
  bool force = false;
};

wire::Time stamp(Time time) {
  const base::Nanos ns = nanosOf(time);
  return {static_cast<std::uint32_t>(ns / 1'000'000'000),
          static_cast<std::uint32_t>(ns % 1'000'000'000 / 1000)};
}

std::unique_ptr<record::SampleFile> sampleFile(const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension();
  if (extension == ".csv") return std::make_unique<record::CsvFile>(file);
  if (extension == ".mcap") return std::make_unique<record::McapFile>(file);
  return nullptr;
}

// Every report as the message that carried it.
void logReports(Client& client, record::VrpnLog& log, wire::LocalSender sender) {
  const auto add = [&log, sender](Time time, const wire::Message& message) {
    log.add(stamp(time), sender, message);
  };
  const auto flag = [](bool value) -> wire::Bool16 { return value ? 1 : 0; };
  client.onPose([add](const PoseReport& r) {
    add(r.time, wire::TrackerPosQuat{r.sensor, r.sensor, r.position_m, r.orientation});
  });
  client.onVelocity([add](const VelocityReport& r) {
    add(r.time,
        wire::TrackerVelocity{r.sensor, r.sensor, r.velocity_m_per_s, r.rotation, r.rotationInterval_s});
  });
  client.onButton([add](const ButtonReport& r) {
    add(r.time, wire::ButtonChange{r.button, r.pressed ? 1 : 0});
  });
  client.onAnalog([add](const AnalogReport& r) {
    wire::AnalogChannels channels;
    channels.channels.values = r.channels;
    add(r.time, channels);
  });
  client.onForce([add](const ForceReport& r) { add(r.time, wire::Force{r.force_N}); });
  client.onDepth([add](const DepthReport& r) { add(r.time, wire::Dop{r.depth_m}); });
  client.onContactPoint([add](const ContactPointReport& r) {
    add(r.time, wire::Scp{r.position_m, r.orientation});
  });
  client.onTouching(
      [add, flag](const TouchingReport& r) { add(r.time, wire::IsTouching{flag(r.touching)}); });
  client.onTouchedObject([add](const TouchedObjectReport& r) { add(r.time, wire::TouchedObject{r.object}); });
  client.onAngle([add, flag](const AngleReport& r) {
    add(r.time, wire::Angle{r.angle_deg, flag(r.touching)});
  });
  client.onForceError([add](const ForceErrorReport& r) {
    add(r.time, wire::ForceError{static_cast<std::int32_t>(r.error)});
  });
  client.onText([add](const TextReport& r) {
    add(r.time, wire::Text{.severity = static_cast<std::uint32_t>(r.severity), .level = 0, .text = r.text});
  });
}

void pollUntilEnd(Client& client, double seconds) {
  const auto start = std::chrono::steady_clock::now();
  const auto isOver = [&] {
    return seconds > 0 && std::chrono::steady_clock::now() - start >= std::chrono::duration<double>(seconds);
  };
  while (!stopRequested() && !isOver()) {
    client.poll(20ms);  // short, so that signals take effect
    if (!client.connected())
      throw ConnectionLost("the connection to " + client.server() +
                           " was lost; the file holds everything before");
  }
}

void recordTicks(Client& client, record::SampleFile& file, const RecordOptions& options) {
  const auto capabilities = client.waitCapabilities();
  if (!capabilities || !capabilities->subscribe) {
    throw std::runtime_error(client.server() +
                             " is not a hapticd and reports no ticks; record to a file called *.vrpn");
  }
  client.onTick([&](const TickReport& tick) { file.add(sampleOf(client.device(), tick)); });
  client.subscribe(Reports::tick, options.rate_Hz);
  try {
    pollUntilEnd(client, options.seconds);
  } catch (const ConnectionLost&) {
    file.close();
    throw;
  }
  file.close();
}

int run(const RecordOptions& options) {
  keepFile(options.file, options.force);
  const auto samples = sampleFile(options.file);
  if (!samples && std::filesystem::path(options.file).extension() != ".vrpn") {
    throw std::runtime_error("'" + options.file +
                             "': a client records to a file called *.vrpn, *.csv or *.mcap; the server "
                             "itself writes recordings that can be "
                             "replayed: hapticd serve --record FILE.haptics");
  }
  const StopSignals signals;
  Client client(options.server, {.reconnect = false});
  if (samples) {
    recordTicks(client, *samples, options);
  } else {
    record::VrpnLog log(options.file);
    logReports(client, log, log.addSender(client.device()));
    pollUntilEnd(client, options.seconds);
    log.close();
  }
  std::printf("recorded %s to %s\n", options.server.c_str(), options.file.c_str());
  return 0;
}

}  // namespace

void addRecord(CLI::App& app) {
  auto options = std::make_shared<RecordOptions>();
  CLI::App* command = app.add_subcommand("record", "Record the reports of a server as a client");
  command->add_option("server", options->server, "NAME@host[:port] or NAME@tcp://host[:port]")->required();
  command->add_option("file", options->file, "*.vrpn, *.csv or *.mcap")->required();
  command->add_option("--seconds", options->seconds, "Duration; 0: until Ctrl-C")
      ->check(within(0, kLongest_s))
      ->capture_default_str();
  command->add_option("--rate", options->rate_Hz, "At most this many ticks per second, for csv and mcap")
      ->check(within(0.1, 4000))
      ->capture_default_str();
  command->add_flag("--force", options->force, kForceText);
  command->footer(
      "Records what a client receives: reports, in the frame that the server reports, without the scene. The "
      "server\n"
      "itself writes recordings that can be replayed and re-rendered: hapticd serve --record FILE.haptics\n"
      "*.vrpn works with any VRPN server; csv and mcap need the ticks of a hapticd.\n"
      "A csv can be given to --hand of 'hapticd serve' and 'hapticd render'.\n"
      "Examples:\n"
      "  hapticd record Phantom@localhost stroke.mcap --seconds 10\n"
      "  hapticd record Tracker0@lab7 stroke.vrpn");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

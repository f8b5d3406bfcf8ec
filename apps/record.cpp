// hapticd record: writes the reports that a client receives to a file; sends no commands.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "base/printable.h"
#include "client/link.h"
#include "commands.h"
#include "hapticd/client.h"
#include "missing_ticks.h"
#include "reach_device.h"
#include "record/export.h"
#include "record/vrpn_log.h"
#include "sample_of.h"
#include "stop_signals.h"
#include "token_file.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

// What the server answers begins so.
constexpr std::string_view kRecordingTo = "recording to ";
constexpr std::string_view kRecorded = "recorded ";

struct RecordOptions {
  bool onServer = false;
  bool detach = false;
  bool end = false;
  std::string server;
  std::string file;
  std::string tokenFile;
  double seconds = 0;
  double rate_Hz = 1000;
  bool force = false;
};

// Made when the first report arrives: a server that reports nothing leaves an older file as it is.
std::unique_ptr<record::SampleFile> sampleFile(const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension();
  if (extension == ".csv") return std::make_unique<record::CsvFile>(file);
  return std::make_unique<record::McapFile>(file);
}

// Calls poll(20 ms), short so that signals take effect, until the end, or until it returns false.
void pollUntilEnd(double seconds, const std::function<bool()>& poll) {
  const auto start = std::chrono::steady_clock::now();
  const auto isOver = [&] {
    return seconds > 0 && std::chrono::steady_clock::now() - start >= std::chrono::duration<double>(seconds);
  };
  while (!stopRequested() && !isOver() && poll()) {
  }
}

// Of a recording that this program writes.
bool demandConnected(bool connected, const std::string& server) {
  if (!connected)
    throw ConnectionLost("the connection to " + server + " was lost; the file holds everything before");
  return true;
}

// Every message of the device as it came, also of types that this project does not know. Returns their
// number.
std::size_t recordMessages(const RecordOptions& options) {
  const client::DeviceAddress address = client::parseDevice(options.server);
  client::Link link(address.server, {.reconnect = false, .adoptNames = true});
  const wire::LocalSender device = link.addDevice(address.device);
  link.onUp = [&] {
    constexpr std::uint32_t kKinds = wire::kReportDefault | wire::kReportHip | wire::kReportContactPoint;
    link.sendNow(device, wire::Subscribe{.kinds = kKinds, .rate = 0});
  };
  reachDevice(link, address, device);
  std::optional<record::VrpnLog> log;
  wire::LocalSender sender;
  std::size_t count = 0;
  const auto add = [&](const client::Arrival& arrival) {
    const bool report = arrival.kind != wire::kindOf<wire::Pong>;
    if (arrival.what != client::Arrival::What::message || arrival.sender != device || !report) return;
    if (arrival.type.value < 0) return;
    const std::string& type = link.names().types()[static_cast<std::size_t>(arrival.type.value)];
    if (!log) sender = log.emplace(options.file).addSender(address.device);
    log->addRaw(arrival.time, sender, type, arrival.bytes);
    ++count;
  };
  pollUntilEnd(options.seconds, [&] {
    link.poll(20ms, add);
    return demandConnected(link.connected(), address.server.text());
  });
  if (log) log->close();
  return count;
}

std::size_t recordTicks(const RecordOptions& options) {
  Client client(options.server, {.reconnect = false});
  const auto capabilities = client.waitCapabilities();
  if (!capabilities || !capabilities->subscribe) {
    throw std::runtime_error(client.server() +
                             " is not a hapticd and reports no ticks; record to a file called *.vrpn");
  }
  std::unique_ptr<record::SampleFile> file;
  std::size_t count = 0;
  MissingTicks missing;
  client.onTick([&](const TickReport& tick) {
    if (!missing.add(tick)) return;
    if (!file) file = sampleFile(options.file);
    file->add(sampleOf(client.device(), tick));
    ++count;
  });
  client.subscribe(Reports::tick, options.rate_Hz);
  try {
    pollUntilEnd(options.seconds, [&] {
      client.poll(20ms);
      return demandConnected(client.connected(), client.server());
    });
  } catch (const ConnectionLost&) {
    if (file) file->close();
    throw;
  }
  if (file) file->close();
  missing.print("hapticd record", options.rate_Hz, capabilities->servoRate_Hz);
  return count;
}

// Begins and ends a recording of the server itself; it answers by texts.
class ServerRecording {
 public:
  ServerRecording(const std::string& server, const std::string& token)
      : server_(server),
        address_(client::parseDevice(server)),
        link_(address_.server, {.reconnect = false, .adoptNames = true}),
        device_(link_.addDevice(address_.device)) {
    reachDevice(link_, address_, device_, isHapticd_);
    if (!token.empty()) link_.sendNow(device_, wire::Identify{.token = std::string_view(token)});
  }

  /// The answer, which begins like this.
  std::string ask(bool record, const std::string& name, std::string_view answer) {
    link_.sendNow(device_, wire::RecordingControl{.record = static_cast<std::int16_t>(record),
                                                  .name = std::string_view(name)});
    const auto end = std::chrono::steady_clock::now() + kAnswerTime;
    while (link_.connected() && std::chrono::steady_clock::now() < end) {
      poll();
      if (last_.starts_with(answer)) return last_;
      check();
    }
    throw Error(server_ + " did not answer within 5 s; " +
                (isHapticd_ ? "it is busy, or its disk is: its log tells whether it records"
                            : "only a hapticd records by itself"));
  }
  /// Throws when the server refused, or could not write the recording further.
  void check() const {
    if (!refusal_.empty()) throw Error(server_ + ": " + refusal_);
  }
  /// The recording that this client began is complete: another one ended it.
  bool ended() const { return last_.starts_with(kRecorded); }
  const std::string& last() const { return last_; }
  bool poll() {
    link_.poll(20ms, [this](const client::Arrival& arrival) {
      if (arrival.what != client::Arrival::What::message || arrival.kind != wire::kindOf<wire::Text>) return;
      if (arrival.sender != device_) return;  // another device of the server
      const auto text = wire::decode<wire::Text>(arrival.bytes);
      if (!text) return;
      const std::string heard = base::printable(text->text.text);
      if (text->severity == wire::kTextError && heard.starts_with("Recording_Control")) refusal_ = heard;
      if (text->severity == wire::kTextWarning && heard.starts_with(kRecordingTo))
        std::fprintf(stderr, "hapticd record: %s\n", heard.c_str());
      const bool answers = heard.starts_with(kRecordingTo) || heard.starts_with(kRecorded);
      if (text->severity == wire::kTextNormal && answers) last_ = heard;
    });
    return link_.connected();
  }

 private:
  const std::string server_;
  const client::DeviceAddress address_;
  client::Link link_;
  const wire::LocalSender device_;
  bool isHapticd_ = false;
  std::string last_;
  std::string refusal_;
};

int recordOnServer(const RecordOptions& options) {
  ServerRecording recording(options.server, tokenFor(options.server, options.tokenFile));
  const StopSignals signals;
  std::string name;  // of the file; empty: end whichever is at hand
  if (!options.end) {
    const std::string answer = recording.ask(true, options.file, kRecordingTo);
    std::printf("%s: %s\n", options.server.c_str(), answer.c_str());
    std::fflush(stdout);
    if (options.detach) return 0;
    name = std::filesystem::path(answer.substr(kRecordingTo.size())).filename();
    pollUntilEnd(options.seconds, [&] {
      const bool connected = recording.poll();
      recording.check();
      if (recording.ended()) return false;
      if (connected) return true;
      throw ConnectionLost("the connection was lost; the server records on until 'hapticd record " +
                           options.server + " --server --end'");
    });
    if (recording.ended()) {
      std::printf("%s: another client ended it: %s\n", options.server.c_str(), recording.last().c_str());
      return options.seconds > 0 ? 1 : 0;  // shorter than wanted
    }
  }
  std::printf("%s: %s\n", options.server.c_str(), recording.ask(false, name, kRecorded).c_str());
  return 0;
}

int run(const RecordOptions& options) {
  if (options.onServer) return recordOnServer(options);
  keepFile(options.file, options.force);
  const std::string extension = std::filesystem::path(options.file).extension();
  const bool samples = extension == ".csv" || extension == ".mcap";
  if (!samples && extension != ".vrpn") {
    throw std::runtime_error("'" + options.file +
                             "': a client records to a file called *.vrpn, *.csv or *.mcap; the server "
                             "itself writes recordings that can be replayed: hapticd record " +
                             options.server + " --server, or hapticd serve --record FILE.haptics");
  }
  const StopSignals signals;
  const std::size_t count = samples ? recordTicks(options) : recordMessages(options);
  if (count == 0) {
    throw std::runtime_error("nothing to record: " + options.server + " reported nothing within the time; " +
                             options.file + " is not written");
  }
  std::printf("recorded %zu %s of %s to %s\n", count, samples ? "ticks" : "messages", options.server.c_str(),
              options.file.c_str());
  return 0;
}

}  // namespace

void addRecord(CLI::App& app) {
  auto options = std::make_shared<RecordOptions>();
  CLI::App* command = app.add_subcommand("record", "Record the reports of a server as a client");
  command->add_option("server", options->server, "NAME@host[:port] or NAME@tcp://host[:port]")->required();
  CLI::Option* const file =
      command->add_option("file", options->file,
                          "*.vrpn, *.csv or *.mcap; with --server a name that ends with .haptics, or none");
  CLI::Option* const onServer = command->add_flag(
      "--server", options->onServer,
      "The server itself records, scene included, on its own disk, until --seconds or Ctrl-C");
  CLI::Option* const detach =
      command->add_flag("--detach", options->detach, "With --server: begin the recording and return")
          ->needs(onServer);
  CLI::Option* const end =
      command->add_flag("--end", options->end, "With --server: end the recording at hand")
          ->needs(onServer)
          ->excludes(file)
          ->excludes(detach);
  addTokenFile(*command, options->tokenFile)->needs(onServer);
  command->add_option("--seconds", options->seconds, "Duration; 0: until Ctrl-C")
      ->check(within(0, kLongest_s))
      ->capture_default_str()
      ->excludes(detach)
      ->excludes(end);
  command->add_option("--rate", options->rate_Hz, "At most this many ticks per second, for csv and mcap")
      ->check(within(0.1, 4000))
      ->capture_default_str()
      ->excludes(onServer);
  command->add_flag("--force", options->force, kForceText)->excludes(onServer);
  command->footer(
      "Records what a client receives: reports, in the frame that the server reports, without the scene. The "
      "server\n"
      "itself writes recordings that can be replayed and re-rendered: --server, or hapticd serve --record "
      "FILE.haptics\n"
      "*.vrpn works with any VRPN server; csv and mcap need the ticks of a hapticd.\n"
      "A csv can be given to --hand of 'hapticd serve' and 'hapticd render'.\n"
      "Examples:\n"
      "  hapticd record Phantom@localhost stroke.mcap --seconds 10\n"
      "  hapticd record Tracker0@lab7 stroke.vrpn\n"
      "  hapticd record Phantom@localhost --server trial3.haptics --seconds 60");
  command->callback([options] {
    if (options->file.empty() && !options->onServer) throw CLI::RequiredError("file");
    exitCode = run(*options);
  });
}

}  // namespace hapticd::apps

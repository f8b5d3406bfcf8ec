// hapticd watch: shows reports on a terminal or streams them to other programs; a client that sends no
// commands.
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>

#include "commands.h"
#include "hapticd/client.h"
#include "live_table.h"
#include "missing_ticks.h"
#include "record/text_fields.h"
#include "report_summary.h"
#include "report_view.h"
#include "sample_of.h"
#include "stop_signals.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

struct WatchOptions {
  std::string server = "Phantom@localhost";
  double seconds = 0;
  double rate_Hz = 0;
  bool json = false;
  bool csv = false;
};

void printJson(const PartOfSample& part) {
  std::string text;
  {
    record::JsonObject object(text);
    fields(part.sample, KnownFields(object, part.unknown));
  }
  std::printf("%s\n", text.c_str());
}

void printCsv(const PartOfSample& part) {
  std::string text;
  record::CsvRow row(text);
  fields(part.sample, KnownFields(row, part.unknown));
  std::printf("%s\n", text.c_str());
}

void printError(const std::string& line) {
  std::fprintf(stderr, "%s\n", line.c_str());
}

// Returns after `seconds` or at a stop signal. The client connects again when the server comes back.
template <class OnInterval, class OnConnection>
void pollUntilEnd(Client& client, double seconds, std::chrono::nanoseconds interval, OnInterval onInterval,
                  OnConnection onConnection) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  auto next = start + interval;
  bool connected = true;
  while (!stopRequested()) {
    const auto now = Clock::now();
    if (seconds > 0 && std::chrono::duration<double>(now - start).count() >= seconds) return;
    if (now >= next) {
      if (connected) onInterval();
      next = std::max(next + interval, now - interval);
    }
    const auto left = std::max(next - Clock::now(), Clock::duration::zero());
    client.poll(std::min<std::chrono::nanoseconds>(left, 20ms));  // short, so that signals take effect
    if (connected != client.connected())
      onConnection(connected ? "the connection to " + client.server() + " was lost; waiting for it"
                             : "connected to " + client.server() + " again");
    connected = client.connected();
  }
}

// Prints each tick at the chosen rate; with servers that send no ticks, the latest reports.
void stream(Client& client, const WatchOptions& options) {
  const auto print = options.csv ? printCsv : printJson;
  if (options.csv) std::fputs(record::csvHeader<record::Sample>().c_str(), stdout);
  const double rate_Hz = options.rate_Hz > 0 ? options.rate_Hz : 10;
  const auto capabilities = client.waitCapabilities();
  const bool whole = capabilities && capabilities->subscribe;
  MissingTicks missing;
  if (whole) {
    client.onTick([&](const TickReport& tick) {
      if (missing.add(tick)) print({sampleOf(client.device(), tick), {}});
    });
    client.subscribe(Reports::tick, rate_Hz);
  }
  const auto period = std::chrono::nanoseconds(std::llround(1e9 / rate_Hz));
  const auto flush = [&] {
    if (!whole) print(sampleOf(client.device(), client.latest()));
    std::fflush(stdout);
    if (std::ferror(stdout) != 0) throw Error(kNotWritten);
  };
  pollUntilEnd(client, options.seconds, period, flush, [&](const std::string& line) {
    printError(line);
    missing.restart();
  });
  if (whole) missing.print("hapticd watch", rate_Hz, capabilities->servoRate_Hz);
}

void show(Client& client, const WatchOptions& options) {
  if (options.rate_Hz > 0) client.setUpdateRate(options.rate_Hz);
  ReportSummary summary(client);
  ReportView view(client);
  LiveTable table;
  summary.restart();
  const bool live = onTerminal();
  const auto print = [&] {
    if (live) {
      table.show(view.table(summary));
    } else {
      view.printLine(summary);
    }
  };
  const auto say = [&](const std::string& line) {
    if (live) {
      table.say(line);
    } else {
      printError(line);
    }
  };
  pollUntilEnd(client, options.seconds, live ? 100ms : 1000ms, print, say);
  std::printf("%s", summary.text().c_str());
}

int run(const WatchOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);  // so that `watch --json | head` ends with a write error
  const StopSignals signals;
  Client client(options.server);
  if (options.json || options.csv) {
    stream(client, options);
  } else {
    show(client, options);
  }
  return 0;
}

}  // namespace

void addWatch(CLI::App& app) {
  auto options = std::make_shared<WatchOptions>();
  CLI::App* command =
      app.add_subcommand("watch", "Show pose, contact and force live, or stream them to other programs");
  command->add_option("server,--server", options->server, "NAME@host[:port] or NAME@tcp://host[:port]")
      ->capture_default_str();
  command->add_option("--seconds", options->seconds, "How long to watch; 0: until Ctrl-C")
      ->check(within(0, kLongest_s))
      ->capture_default_str();
  command->add_option("--rate", options->rate_Hz, "Reports or lines per second [the server's rate; 10 lines]")
      ->check(within(0.1, 4000));
  CLI::Option* json = command->add_flag("--json", options->json, "Print one line of JSON for each tick");
  command->add_flag("--csv", options->csv, "Print one line of CSV for each tick, after a header line")
      ->excludes(json);
  command->footer(
      "Sends no commands, so it does not affect other clients. Also works with other VRPN servers.\n"
      "Examples:\n"
      "  hapticd watch                                    a live table of Phantom@localhost\n"
      "  hapticd watch Phantom@lab7 --json | jq .depth_m\n"
      "  hapticd watch --csv --rate 1000 --seconds 5 > stroke.csv");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

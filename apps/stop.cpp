// hapticd stop: the emergency stop of a device anywhere, and how to end it.
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include "commands.h"
#include "hapticd/client.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

struct StopOptions {
  std::string server = "Phantom@localhost";
  bool rearm = false;
};

int run(const StopOptions& options) {
  Client client(options.server, {.reconnect = false});
  std::optional<GuardReport> guard;
  std::string refusal;
  client.onGuard([&](const GuardReport& report) { guard = report; });
  client.onText([&](const TextReport& text) {
    if (text.severity == Severity::error) refusal = text.text;
  });
  if (options.rearm) {
    client.rearmForces();
  } else {
    client.stopForces();
  }
  // The server's word that it is so counts, not ours that we sent it.
  const auto isDone = [&] { return guard && guard->stopped != options.rearm; };
  const auto end = std::chrono::steady_clock::now() + 3s;
  while (!isDone() && refusal.empty() && std::chrono::steady_clock::now() < end) client.poll(50ms);
  if (!refusal.empty()) throw Error(client.server() + " refused: " + refusal);
  if (!isDone()) throw Error(client.server() + " did not confirm it within 3 s");
  std::printf(options.rearm ? "%s: forces may come back; they ramp in over half a second\n"
                            : "%s: forces are off; 'hapticd stop --rearm' ends that\n",
              options.server.c_str());
  if (options.rearm && !guard->armed) std::printf("this device is not enabled: serve it with --enable-forces\n");
  return 0;
}

}  // namespace

void addStop(CLI::App& app) {
  auto options = std::make_shared<StopOptions>();
  CLI::App* command = app.add_subcommand("stop", "Bring the force of a device to zero at once, until re-armed");
  command->add_option("server", options->server, "NAME@host[:port] or NAME@tcp://host[:port]")
      ->capture_default_str();
  command->add_flag("--rearm", options->rearm, "End a stop and clear latched faults");
  command->footer(
      "Any client may stop a device; who re-arms it must be allowed to command it.\n"
      "Returns 0 when the server has confirmed it, 1 when it is not there or cannot.");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

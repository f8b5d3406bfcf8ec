// hapticd stop: brings the force of any reachable device to zero, or re-arms it.
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
  // Success means that the server confirmed the new state, not that the message was sent.
  const auto isDone = [&] { return guard && guard->stopped != options.rearm; };
  const auto end = std::chrono::steady_clock::now() + 3s;
  while (!isDone() && refusal.empty() && std::chrono::steady_clock::now() < end) client.poll(50ms);
  if (!refusal.empty()) throw Error(client.server() + " refused: " + refusal);
  if (!isDone()) throw Error(client.server() + " sent no confirmation within 3 s");
  std::printf(options.rearm ? "%s: re-armed; forces ramp in over half a second\n"
                            : "%s: forces are off; 'hapticd stop --rearm' re-arms\n",
              options.server.c_str());
  if (options.rearm && !guard->armed)
    std::printf("forces are not enabled on this device: start the server with --enable-forces\n");
  return 0;
}

}  // namespace

void addStop(CLI::App& app) {
  auto options = std::make_shared<StopOptions>();
  CLI::App* command =
      app.add_subcommand("stop", "Bring the force of a device to zero immediately, until re-armed");
  command->add_option("server", options->server, "NAME@host[:port] or NAME@tcp://host[:port]")
      ->capture_default_str();
  command->add_flag("--rearm", options->rearm, "End a stop and clear latched faults");
  command->footer(
      "Any client may stop a device; only clients that may command it can re-arm it.\n"
      "Exit status: 0 when the server has confirmed it, 1 when it cannot be reached or refuses.");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

// hapticd stop: brings the force of any reachable device to zero, or re-arms it.
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include "client/server_address.h"
#include "commands.h"
#include "hapticd/client.h"
#include "net/endpoint.h"
#include "net/local_socket.h"
#include "print_json.h"
#include "token_file.h"
#include "wire/messages.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

struct StopOptions {
  std::string server = "Phantom@localhost";
  bool rearm = false;
  bool json = false;
  std::string tokenFile;
};

// On this machine, the server's Unix socket takes a stop when its port is full, and there the kernel names
// the user who re-arms. Empty: none, or another machine.
std::string socketOf(const StopOptions& options) {
  const client::DeviceAddress address = client::parseDevice(options.server);
  const std::string host = address.server.host == "localhost" ? "127.0.0.1" : address.server.host;
  try {
    const net::Endpoint server = net::Endpoint::parse(host, address.server.port);
    const auto path = net::findServerSocket(server, options.rearm);
    return path ? address.device + "@unix:" + path->string() : "";
  } catch (const net::Error&) {
    return "";  // the name of a machine
  }
}

Client openClient(const StopOptions& options) {
  if (const std::string local = socketOf(options); !local.empty()) {
    try {
      return Client(local, {.connectTimeout = 1s, .reconnect = false});
    } catch (const Error&) {
      // Of a server that was killed, or without this device.
    }
  }
  return Client(options.server, {.reconnect = false});
}

int run(const StopOptions& options) {
  const std::string token = tokenFor(options.server, options.tokenFile);
  Client client = openClient(options);
  if (!token.empty()) client.presentToken(token);
  std::optional<GuardReport> guard;
  const char* const refused = options.rearm ? "Rearm_Forces refused" : "Stop_Forces refused";
  std::string refusal;
  std::string fault;
  std::string remark;
  bool answered = false;
  client.onGuard([&](const GuardReport& report) { guard = report; });
  client.onText([&](const TextReport& text) {
    if (text.severity != Severity::error) return;
    // A fault of the device is no answer, but the reason to stop. Nor is what the server says of a token or
    // of a recording: what became of the forces, the guard tells.
    (text.text.find(refused) != std::string::npos ? refusal
     : text.text.starts_with(wire::kNoForceText)  ? fault
                                                  : remark) = text.text;
  });
  client.onToRoom([&](const ToRoomReport&) { answered = true; });
  if (options.rearm) {
    client.rearmForces();
  } else {
    client.stopForces();
  }
  // Success means that the server confirmed the new state, not that the message was sent. A refusal would
  // come before the answer to this question.
  client.requestToRoom();
  const auto isDone = [&] {
    return answered && guard && guard->stopped != options.rearm && (!options.rearm || guard->latched.empty());
  };
  const auto end = std::chrono::steady_clock::now() + 3s;
  while (!isDone() && refusal.empty() && std::chrono::steady_clock::now() < end) client.poll(50ms);
  if (!refusal.empty()) throw Error(options.server + " refused: " + refusal);
  if (options.rearm && guard && !guard->latched.empty())
    throw Error(options.server + " is not re-armed: " + namesOf(guard->latched) + " is latched again" +
                (fault.empty() ? "" : "; " + fault));
  if (!isDone()) {
    throw Error(
        options.server +
        " sent no confirmation within 3 s; a replay has no force to stop, and for a device use its own "
        "switch" +
        (remark.empty() ? "" : "; it said: " + remark));
  }
  for (const std::string& text : {fault, remark})
    if (!text.empty()) std::fprintf(stderr, "hapticd: %s\n", text.c_str());
  if (options.json) {
    printJson({{"server", options.server}, {"stopped", guard->stopped}, {"armed", guard->armed}});
    return 0;
  }
  std::printf(
      !options.rearm
          ? "%s: forces are off until an operator or the server's user re-arms: 'hapticd stop --rearm'\n"
      : fault.empty() ? "%s: re-armed; forces ramp in over half a second\n"
                      : "%s: re-armed; forces come back once the device gives them\n",
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
  command
      ->add_option("server,--server", options->server,
                   "NAME@host[:port], NAME@tcp://host[:port] or NAME@unix:PATH")
      ->capture_default_str();
  command->add_flag("--rearm", options->rearm, "End a stop and clear latched faults");
  addTokenFile(*command, options->tokenFile);
  command->add_flag("--json", options->json, kJsonText);
  command->footer(
      "Any client may stop a device. Re-arming after it takes the server's user or root on its machine, or\n"
      "the token of an operator. Where the server's configuration names a socket, its user re-arms by\n"
      "  hapticd stop --rearm NAME@unix:PATH\n"
      "A server on another machine that asks for TLS is reached through a tunnel, which can present the "
      "token:\n"
      "  hapticd tunnel HOST --port 4000 --fingerprint ... --token-file FILE\n"
      "  hapticd stop NAME@tcp://127.0.0.1:4000\n"
      "Exit status: 0 when the server has confirmed it, 1 when it cannot be reached or refuses, or\n"
      "when this cannot be printed.");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

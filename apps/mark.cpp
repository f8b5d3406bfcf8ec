// hapticd mark: marks a moment of an experiment in the server's recording and for all clients.
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>

#include "base/printable.h"
#include "client/link.h"
#include "commands.h"
#include "hapticd/client.h"
#include "reach_device.h"
#include "wire/codec.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

struct MarkOptions {
  std::string text;
  std::string server = "Phantom@localhost";
};

// The server sends every marker to all clients: its arrival confirms it.
int run(const MarkOptions& options) {
  const client::DeviceAddress address = client::parseDevice(options.server);
  client::Link link(address.server, {.reconnect = false, .adoptNames = true});
  const wire::LocalSender device = link.addDevice(address.device);
  bool isHapticd = false;
  reachDevice(link, address, device, isHapticd);
  link.sendNow(device, wire::Marker{.time = 0, .text = options.text});
  bool confirmed = false;
  std::string refusal;
  std::string error;  // of something else, such as a fault of the device
  std::string remark;
  const auto hear = [&](const client::Arrival& arrival) {
    if (arrival.what != client::Arrival::What::message) return;
    if (arrival.kind == wire::kindOf<wire::Marker>) {
      const auto marker = wire::decode<wire::Marker>(arrival.bytes);
      confirmed = confirmed || (marker && marker->text.text == options.text);
    } else if (arrival.kind == wire::kindOf<wire::Text> && arrival.sender == device) {
      const auto text = wire::decode<wire::Text>(arrival.bytes);
      if (!text) return;
      const std::string heard = base::printable(text->text.text);
      if (text->severity == wire::kTextError)
        (heard.find("Marker refused") != std::string::npos ? refusal : error) = heard;
      if (text->severity == wire::kTextNormal) remark = heard;
    }
  };
  const auto end = std::chrono::steady_clock::now() + kAnswerTime;
  while (!confirmed && refusal.empty() && link.connected() && std::chrono::steady_clock::now() < end)
    link.poll(20ms, hear);
  if (!refusal.empty()) throw Error(options.server + " refused: " + refusal);
  if (!confirmed)
    throw Error(options.server + " did not confirm the marker within 5 s" +
                (isHapticd ? "" : "; only a hapticd takes markers") +
                (error.empty() ? "" : "; it said: " + error));
  std::printf("%s: marked \"%s\"\n", options.server.c_str(), options.text.c_str());
  if (!remark.empty()) std::printf("%s: %s\n", options.server.c_str(), remark.c_str());
  if (!error.empty()) std::fprintf(stderr, "hapticd: %s: %s\n", options.server.c_str(), error.c_str());
  return 0;
}

}  // namespace

void addMark(CLI::App& app) {
  auto options = std::make_shared<MarkOptions>();
  CLI::App* command =
      app.add_subcommand("mark", "Mark a moment, such as \"trial 3 begins\", in the recording of a server");
  command->add_option("text", options->text, "At most 255 bytes")
      ->required()
      ->check([](const std::string& t) {
        return t.empty() || t.size() > 255 ? std::string("must have 1 to 255 bytes") : std::string();
      });
  command->add_option("--server", options->server, "NAME@host[:port] or NAME@tcp://host[:port]")
      ->capture_default_str();
  command->footer(
      "The marker reaches all clients, too; the viewer shows it in its plots.\n"
      "Example: hapticd mark \"trial 3 begins\" --server Phantom@lab7");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

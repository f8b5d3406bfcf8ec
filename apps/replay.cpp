// hapticd replay: serves a recording to clients as if it were live.
#include <spdlog/spdlog.h>

#include <cstdio>
#include <memory>
#include <string>

#include "announce.h"
#include "commands.h"
#include "log_writer.h"
#include "network_finder.h"
#include "server/player.h"
#include "server/server.h"
#include "stop_on_signal.h"

namespace hapticd::apps {
namespace {

struct ReplayOptions {
  server::ReplayOptions replay;
  std::string listen;
  std::string http;
  int port = -1;
  double seconds = 0;
};

int run(const ReplayOptions& options) {
  StopOnSignal stopper;
  const LogWriter log;
  auto player = std::make_unique<server::Player>(options.replay);
  server::ServerConfig config = player->config();
  config.insecure = true;  // a recording takes no commands
  if (!options.listen.empty()) server::parseListen(options.listen, config.listenAddress, config.port);
  if (options.port >= 0) config.port = static_cast<std::uint16_t>(options.port);
  if (!options.http.empty()) config.http = options.http;
  config.seconds = options.seconds;
  server::validate(config);

  const server::Player& played = *player;
  server::Server server(config, std::move(player));
  logAddresses(server, config, "replay");
  const std::unique_ptr<zeroconf::Announcer> announcer = announceOnNetwork(server, config);
  listNetworkOnPage(server);
  if (!isReachedFromHereOnly(server))
    spdlog::warn("everybody who reaches this machine may see the replay: it asks for neither TLS nor tokens");
  stopper.watch(server);
  server.run();
  stopper.finish();
  const std::string remark = played.remark();
  if (!remark.empty()) std::fprintf(stderr, "hapticd: %s\n", remark.c_str());
  return statusFor(remark);
}

}  // namespace

void addReplay(CLI::App& app) {
  auto options = std::make_shared<ReplayOptions>();
  CLI::App* command = app.add_subcommand("replay", "Serve a recording to clients");
  command->add_option("file", options->replay.file, "Recording of 'hapticd serve --record'")
      ->required()
      ->check(existingFile());
  command->add_option("--speed", options->replay.speed, "Factor: 2 is twice as fast, 0.1 ten times slower")
      ->check(within(0.001, 1000))
      ->capture_default_str();
  command->add_flag("--loop", options->replay.loop, "Start again at the end, until a signal");
  command->add_option("--listen", options->listen, "ADDR:PORT for TCP and UDP [127.0.0.1:3883]")
      ->check(notEmpty());
  command->add_option("--port", options->port, "Only the port; 0: any free one")
      ->check(withinIntegers(0, 65535));
  command
      ->add_option("--http", options->http,
                   "ADDR:PORT of the viewer's page, or 'off' [127.0.0.1:8080, if free]")
      ->check(notEmpty());
  command->add_option("--seconds", options->seconds, "Stop after this time; 0: run until a signal [0]")
      ->check(within(0, kLongest_s));
  command->footer(
      "Clients connect as to the live server and receive the recorded reports, stamped with the present "
      "time, and the\n"
      "recorded scene. Their commands are refused. After the end the last state stays until a signal.\n"
      "Examples:\n"
      "  hapticd replay my.haptics\n"
      "  hapticd replay my.haptics --speed 0.2 --loop --port 4000");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

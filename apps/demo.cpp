// hapticd demo: a server with the simulated hand, the Stanford bunny in it, and the address of its page.
#include <spdlog/spdlog.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "announce.h"
#include "bunny.h"
#include "commands.h"
#include "fit_mesh.h"
#include "hapticd/client.h"
#include "network_finder.h"
#include "server/server.h"
#include "stop_on_signal.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

struct DemoOptions {
  std::string listen;
  std::string http;
  double seconds = 0;
};

// The usual ports; others where another program has them.
std::unique_ptr<server::Server> startServer(const DemoOptions& options, server::ServerConfig& config) {
  struct Ports {
    std::uint16_t vrpn;
    const char* http;
  };
  config.insecure = true;  // a simulated hand hurts nobody
  if (!options.listen.empty()) server::parseListen(options.listen, config.listenAddress, config.port);
  if (options.seconds > 0) config.seconds = options.seconds;
  for (const Ports& ports :
       {Ports{3883, "127.0.0.1:8080"}, Ports{3883, "127.0.0.1:0"}, Ports{0, "127.0.0.1:0"}}) {
    if (options.listen.empty()) config.port = ports.vrpn;
    config.http = options.http.empty() ? ports.http : options.http;
    server::validate(config);
    try {
      return std::make_unique<server::Server>(config);
    } catch (const net::Error&) {
      const bool last = ports.vrpn == 0 || (!options.listen.empty() && !options.http.empty());
      if (last) throw;
    }
  }
  return nullptr;  // not reached: the last attempt returns or throws
}

// Sends the bunny and waits for the first force on it. `page` is empty where there is none.
void present(const std::string& address, const std::string& page, const std::atomic<bool>& ending) {
  Client client("Phantom@tcp://" + address, {.reconnect = false});
  geometry::TriangleMesh mesh = bunny();
  fitIntoWorkspace(mesh);
  std::vector<std::array<float, 3>> vertices;
  for (const auto& v : mesh.vertices) vertices.push_back({v.x(), v.y(), v.z()});
  client.setSurface(0, {.stiffness = 0.8F, .damping = 0.1F, .staticFriction = 0.3F, .dynamicFriction = 0.2F});
  client.uploadMesh(0, {vertices, mesh.triangles});
  std::printf("The simulated hand explores the Stanford bunny.\n");
  if (!page.empty())
    std::printf("  see it:    open %s in a browser, and drag the hand over the bunny\n", page.c_str());
  std::printf(
      "  touch:     hapticd touch FILE --server Phantom@%s\n"
      "  watch:     hapticd watch Phantom@%s\n"
      "  stop it:   Ctrl-C\n",
      address.c_str(), address.c_str());
  std::fflush(stdout);
  const auto end = std::chrono::steady_clock::now() + 30s;
  const auto force_N = [&client] {
    const auto& f = client.latest().force.force_N;
    return std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  };
  while (!ending && std::chrono::steady_clock::now() < end) {
    client.poll(50ms);
    if (force_N() < 0.1) continue;
    std::printf("First contact: %.2f N.\n", force_N());
    std::fflush(stdout);
    return;
  }
}

int run(const DemoOptions& options) {
  spdlog::set_pattern("%H:%M:%S.%e %^%l%$ %v");
  spdlog::set_level(spdlog::level::warn);
  StopOnSignal stopper;
  server::ServerConfig config;
  const std::unique_ptr<server::Server> server = startServer(options, config);
  const std::unique_ptr<zeroconf::Announcer> announcer = announceOnNetwork(*server, config);
  listNetworkOnPage(*server);
  const auto web = server->webAddress();
  if (!isReachedFromHereOnly(*server))
    std::fprintf(stderr,
                 "hapticd: everybody who reaches this machine may lead the demo; its hand hurts nobody\n");
  stopper.watch(*server);
  const std::string page = web ? "http://" + reachedFromHere(*web).text() + "/" : "";
  std::atomic<bool> ending{false};
  std::exception_ptr failure;
  std::thread presenter([&, address = reachedFromHere(server->address()).text()] {
    try {
      present(address, page, ending);
    } catch (...) {
      failure = std::current_exception();
      server->stop();
    }
  });
  server->run();
  ending = true;
  presenter.join();
  stopper.finish();
  if (failure) std::rethrow_exception(failure);
  return 0;
}

}  // namespace

void addDemo(CLI::App& app) {
  auto options = std::make_shared<DemoOptions>();
  CLI::App* command = app.add_subcommand(
      "demo", "Start a server with a simulated hand that explores a scan; prints the address of its page");
  CLI::Option* listen = command
                            ->add_option("--listen", options->listen,
                                         "ADDR:PORT for TCP and UDP [127.0.0.1:3883, or a free port]")
                            ->check(notEmpty());
  command
      ->add_option_function<int>(
          "--port", [options](int port) { options->listen = "127.0.0.1:" + std::to_string(port); },
          "Only the port; 0: any free one")
      ->check(withinIntegers(0, 65535))
      ->excludes(listen);
  command
      ->add_option("--http", options->http,
                   "ADDR:PORT of the page, or 'off' [127.0.0.1:8080, or a free port]")
      ->check(notEmpty());
  command->add_option("--seconds", options->seconds, "Stop after this time [until Ctrl-C]")
      ->check(within(0.001, kLongest_s));
  command->footer("It needs no hardware, no file and no rights.");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

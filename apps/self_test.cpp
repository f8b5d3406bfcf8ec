// hapticd self-test: 20 seconds that tell an operator whether the installed program works on this machine.
#include <netinet/in.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "bunny.h"
#include "commands.h"
#include "fit_mesh.h"
#include "hapticd/client.h"
#include "loop_check.h"
#include "realtime/render/renderer.h"
#include "record/crc32.h"
#include "scene/builder.h"
#include "server/server.h"
#include "server/web/web_assets.h"
#include "version.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;
using geometry::Vec3;

// Checksum of the forces of goldenForces() under the present laws (realtime::kForceLaw).
constexpr std::uint32_t kGoldenForces = 0x4f928a2a;

struct Outcome {
  bool good = false;
  std::string text;
  std::string remedy;
};

// A point that circles into the bunny and out of it, rendered offline: the same bytes on every machine.
Outcome goldenForces() {
  geometry::TriangleMesh mesh = bunny();
  fitIntoWorkspace(mesh);
  scene::SceneBuilder builder;
  std::vector<scene::Notice> notices;
  builder.apply(1, scene::BeginBatch{}, 0, notices);
  builder.apply(1, scene::SetVertices{0, 0, std::move(mesh.vertices)}, 0, notices);
  builder.apply(1, scene::SetTriangles{0, 0, std::move(mesh.triangles), false}, 0, notices);
  builder.apply(1, scene::SetSurfaceProperty{0, "stiffness", 0.8}, 0, notices);
  builder.apply(1, scene::SetSurfaceProperty{0, "static_friction", 0.3}, 0, notices);
  builder.apply(1, scene::SetSurfaceProperty{0, "dynamic_friction", 0.2}, 0, notices);
  builder.apply(1, scene::CommitBatch{}, 0, notices);
  const auto snapshot = builder.publish(0, notices);

  realtime::Renderer renderer;
  realtime::Rendering rendering;
  std::vector<std::array<double, 3>> forces;
  constexpr base::Nanos kTickPeriod = 1'000'000;
  int touching = 0;
  for (int i = 0; i < 4000; ++i) {
    // A spiral down a sphere whose radius swings through the surface.
    const double share = i / 4000.0;
    const double turn = 2 * std::numbers::pi * 9 * share;
    const double radius_m = 0.032 + 0.010 * std::cos(2 * std::numbers::pi * 12 * share);
    const double height = 0.9 - 1.8 * share;
    const double ring = std::sqrt(1 - height * height);
    device::DeviceState state;
    state.time = i * kTickPeriod;
    state.position_m = radius_m * Vec3(ring * std::cos(turn), height, ring * std::sin(turn));
    renderer.step(*snapshot, state, state.time, kTickPeriod, rendering);
    touching += rendering.touching ? 1 : 0;
    const Vec3& f = rendering.force_N;
    forces.push_back({f.x(), f.y(), f.z()});
  }
  const std::uint32_t sum = record::crc32(std::as_bytes(std::span(forces)));
  char text[128];
  std::snprintf(text, sizeof text, "4000 ticks, %d in contact, checksum %08x", touching, sum);
  return {sum == kGoldenForces, text,
          "the forces differ from those of the release: reinstall the package, and report this line"};
}

Outcome loop(double seconds) {
  const LoopCheck check = measureLoop(seconds);
  char text[160];
  std::snprintf(text, sizeof text, "%llu ticks in %g s, %llu overruns, wake-up p99 %.0f us",
                static_cast<unsigned long long>(check.ticks), seconds,
                static_cast<unsigned long long>(check.overruns), check.wakeup_us.p99);
  return {check.ticks > 0, text, "the servo thread does not run: see 'hapticd doctor'"};
}

// A server of our own on free ports, in a thread.
class OwnServer {
 public:
  OwnServer() : server_(config()), thread_([this] { server_.run(); }) {}
  ~OwnServer() {
    server_.stop();
    thread_.join();
  }
  std::string address() const { return server_.address().text(); }
  std::uint16_t webPort() const { return server_.webAddress()->port; }

 private:
  static server::ServerConfig config() {
    server::ServerConfig config;
    config.port = 0;
    config.http = "127.0.0.1:0";
    config.devices.front().blackBoxKeep = 0;
    return config;
  }
  server::Server server_;
  std::thread thread_;
};

// Until the client has felt object 0, or 15 s.
Outcome touchThrough(const std::string& device, bool upload) {
  Client client(device, {.reconnect = false});
  if (upload) {
    geometry::TriangleMesh mesh = bunny();
    fitIntoWorkspace(mesh);
    std::vector<std::array<float, 3>> vertices;
    for (const auto& v : mesh.vertices) vertices.push_back({v.x(), v.y(), v.z()});
    client.setSurface(0,
                      {.stiffness = 0.8F, .damping = 0.1F, .staticFriction = 0.3F, .dynamicFriction = 0.2F});
    client.uploadMesh(0, {vertices, mesh.triangles});
  }
  const auto begin = std::chrono::steady_clock::now();
  double force_N = 0;
  while (std::chrono::steady_clock::now() - begin < 15s) {
    client.poll(50ms);
    const auto& f = client.latest().force.force_N;
    force_N = std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    if (force_N < 0.1 || client.latest().touchedObject.object != 0) continue;
    char text[128];
    std::snprintf(text, sizeof text, "%s feels object 0 with %.2f N", device.c_str(), force_N);
    return {true, text, ""};
  }
  return {false, device + " felt nothing within 15 s",
          "a firewall on the loopback interface? See 'hapticd doctor'"};
}

// The first bytes of the answer to a GET.
std::string get(std::uint16_t port, const std::string& path) {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  const timeval patience{10, 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const std::string request = "GET " + path + " HTTP/1.1\r\nHost: localhost:" + std::to_string(port) +
                              "\r\nConnection: close\r\n\r\n";
  std::string answer;
  if (connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0 &&
      send(fd, request.data(), request.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(request.size())) {
    char buffer[4096];
    for (ssize_t n = 0; answer.size() < 200'000 && (n = recv(fd, buffer, sizeof buffer, 0)) > 0;)
      answer.append(buffer, static_cast<std::size_t>(n));
  }
  close(fd);
  return answer;
}

Outcome viewer(std::uint16_t port) {
  const std::string state = get(port, "/api/state");
  if (state.find(" 200 ") > 20) return {false, "/api/state is not answered", "report this line"};
  if (server::webAssets().empty())
    return {false, "built without the viewer", "install a build with HAPTICD_WEB=ON"};
  const std::string page = get(port, "/");
  const std::string script = get(port, "/viewer.js");
  const bool good = page.find("viewer.js") != std::string::npos && script.find(" 200 ") < 20;
  return {good, good ? "page, script and state are answered" : "the page is not answered",
          "report this line"};
}

int run(double seconds) {
  spdlog::set_level(spdlog::level::err);
  std::printf("%s\n", versionText().c_str());
  int failed = 0;
  const auto check = [&failed](const char* name, const std::function<Outcome()>& run) {
    Outcome outcome;
    try {
      outcome = run();
    } catch (const std::exception& error) {
      outcome = {false, error.what(), ""};
    }
    failed += outcome.good ? 0 : 1;
    std::printf("  %s  %-8s %s\n", outcome.good ? "ok  " : "FAIL", name, outcome.text.c_str());
    if (!outcome.good && !outcome.remedy.empty()) std::printf("        -> %s\n", outcome.remedy.c_str());
    std::fflush(stdout);
  };
  check("forces", goldenForces);
  check("loop", [&] { return loop(seconds); });
  try {
    const OwnServer own;
    check("TCP", [&] { return touchThrough("Phantom@tcp://" + own.address(), true); });
    check("UDP", [&] { return touchThrough("Phantom@" + own.address(), false); });
    check("viewer", [&] { return viewer(own.webPort()); });
  } catch (const std::exception& error) {
    check("server", [&]() -> Outcome { return {false, error.what(), ""}; });
  }
  std::printf(failed == 0 ? "self-test passed\n" : "self-test: %d FAILED\n", failed);
  return failed == 0 ? 0 : 1;
}

}  // namespace

void addSelfTest(CLI::App& app) {
  auto seconds = std::make_shared<double>(5);
  CLI::App* command = app.add_subcommand(
      "self-test", "Check the installed program: forces against golden ones, loop, TCP, UDP, viewer");
  command->add_option("--seconds", *seconds, "Duration of the loop's part")
      ->check(within(0.1, 3600))
      ->capture_default_str();
  command->footer(
      "It opens free ports of this machine only and touches no device. Takes up to 20 s.\n"
      "Exit status: 0 when all checks pass, 1 otherwise. 'hapticd doctor' checks the machine.");
  command->callback([seconds] { exitCode = run(*seconds); });
}

}  // namespace hapticd::apps

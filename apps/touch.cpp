// hapticd touch: sends a mesh to a haptics server as any client would, and shows contact and force.
//
// The client scales the mesh and sends no workspace, so that one unit is one millimetre of the device and the
// object has the requested size on every device; a workspace box would stretch it to the reach of the device.
// Without --size-mm the mesh fills 80 % of the smallest common device, at most 100 mm.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "base/printable.h"
#include "commands.h"
#include "fit_mesh.h"
#include "geometry/crossings.h"
#include "geometry/mesh_check.h"
#include "geometry/triangle_mesh.h"
#include "hapticd/client.h"
#include "live_table.h"
#include "mesh_io/mesh_io.h"
#include "report_summary.h"
#include "report_view.h"
#include "server_list.h"
#include "stop_signals.h"
#include "token_file.h"
#include "wire/messages.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;
using geometry::TriangleMesh;

constexpr std::size_t kLongestName = decltype(wire::SetObjectName::text)::kMost;
constexpr int kLastObject = std::numeric_limits<int>::max() - 1;  // their number must fit, too

struct TouchOptions {
  std::string mesh;
  std::string server = "Phantom@localhost";
  std::string tokenFile;
  bool find = false;
  double seconds = 0;
  Surface surface{.stiffness = 0.8F, .damping = 0.1F, .staticFriction = 0.3F, .dynamicFriction = 0.2F};
  int object = 0;
  double size_mm = 0;
  bool keepScene = false;
  bool replace = false;
  bool trueSize = false;
  bool json = false;
};

std::string extentsText(const TriangleMesh& mesh) {
  const geometry::Vec3 e = geometry::boundsOf(mesh).extents();
  char text[96];
  std::snprintf(text, sizeof text, "%.4g x %.4g x %.4g", e.x(), e.y(), e.z());
  return text;
}

TriangleMesh load(const TouchOptions& options) {
  TriangleMesh mesh = mesh_io::loadMesh(options.mesh);
  std::printf("%s: %zu vertices, %zu %s, %s units\n", options.mesh.c_str(), mesh.vertices.size(),
              mesh.triangles.size(), mesh.triangles.size() == 1 ? "triangle" : "triangles",
              extentsText(mesh).c_str());
  if (mesh.triangles.empty())
    throw std::runtime_error(options.mesh + " has no triangles, so there is nothing to touch");
  auto findings = geometry::describe(geometry::checkMesh(mesh.vertices, mesh.triangles));
  for (std::string& finding : geometry::describe(geometry::findCrossings(mesh.vertices, mesh.triangles)))
    findings.push_back(std::move(finding));
  if (findings.empty()) std::printf("mesh check: clean\n");
  for (const std::string& finding : findings) std::printf("mesh check: %s\n", finding.c_str());
  if (options.trueSize) {
    const geometry::Box bounds = geometry::boundsOf(mesh);
    geometry::scaleAndMove(mesh, 1, -bounds.centre());
    std::printf("%s mm, centred in the workspace\n", extentsText(mesh).c_str());
  } else {
    fitIntoWorkspace(mesh, options.size_mm);
    std::printf("scaled to %s mm, centred in the workspace\n", extentsText(mesh).c_str());
  }
  return mesh;
}

// Returns how long it took, in seconds.
double send(Client& client, const TriangleMesh& mesh, const TouchOptions& options) {
  std::vector<std::array<float, 3>> vertices;
  vertices.reserve(mesh.vertices.size());
  for (const auto& v : mesh.vertices) vertices.push_back({v.x(), v.y(), v.z()});
  if (options.replace) client.resetScene();
  client.setObjectCount(options.object + 1);
  // The object may have another mesh, elsewhere.
  client.clearMesh(options.object);
  client.setTransform(options.object, kIdentity);
  client.setTouchable(options.object, true);
  const std::string name = std::filesystem::path(options.mesh).filename();
  client.setObjectName(options.object, std::string(base::beginning(name, kLongestName)));
  client.setSurface(options.object, options.surface);
  ProgressBar bar("sending");
  const auto start = std::chrono::steady_clock::now();
  client.uploadMesh(options.object, {vertices, mesh.triangles},
                    [&](const UploadProgress& p) { bar.show(p.bytesSent, p.bytesTotal); });
  bar.finish();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void printSent(const Client& client, const TriangleMesh& mesh, const TouchOptions& options, double seconds) {
  std::printf("sent %zu %s in %.3f s to object %d of %s@%s\n", mesh.triangles.size(),
              mesh.triangles.size() == 1 ? "triangle" : "triangles", seconds, options.object,
              client.device().c_str(), client.server().c_str());
}

// A refusal of what was sent comes before the answer to this question, which other servers may not give. Then
// there is nothing to touch; a token that is refused, or a device without a force, leaves the mesh there.
void awaitAnswer(Client& client) {
  if (!client.waitCapabilities()) return;
  bool answered = false;
  std::string refusal;
  const ScopedSubscription answers = client.onToRoom([&](const ToRoomReport&) { answered = true; });
  const ScopedSubscription texts = client.onText([&](const TextReport& report) {
    if (report.severity != Severity::error) return;
    const std::string& text = report.text;
    if (refusal.empty() && text.find("refused") != std::string::npos && !text.starts_with("Identify") &&
        !text.starts_with(wire::kNoForceText)) {
      refusal = text;
    } else {
      std::fprintf(stderr, "hapticd touch: %s: %s\n", client.server().c_str(), text.c_str());
    }
  });
  client.requestToRoom();
  const auto end = std::chrono::steady_clock::now() + 3s;
  while (!answered && !stopRequested() && client.connected() && std::chrono::steady_clock::now() < end)
    client.poll(20ms);
  if (!refusal.empty()) throw Error(client.server() + ": " + refusal);
}

void watch(Client& client, ReportSummary& summary, double seconds) {
  const bool live = onTerminal();
  const auto interval = live ? 250ms : 1000ms;
  ReportView view(client);
  LiveTable table;
  summary.restart();
  auto next = std::chrono::steady_clock::now() + interval;
  while (!stopRequested() && (seconds <= 0 || summary.seconds() < seconds)) {
    client.poll(20ms);  // short, so that signals and the end of --seconds take effect
    if (!client.connected()) throw ConnectionLost("the connection to " + client.server() + " was lost");
    if (std::chrono::steady_clock::now() < next) continue;
    next += interval;
    if (live) {
      table.show(view.table(summary));
    } else {
      view.printLine(summary);
    }
  }
}

int run(const TouchOptions& options) {
  const TriangleMesh mesh = load(options);
  const std::string server = options.find ? onlyDeviceOfNetwork() : options.server;
  if (options.find) std::printf("found %s\n", server.c_str());
  const std::string token = tokenFor(server, options.tokenFile);
  Client client(server, {.reconnect = false});
  if (!token.empty()) client.presentToken(token);
  ReportSummary summary(client);
  const double seconds = send(client, mesh, options);
  const StopSignals signals;  // which would not end the upload
  awaitAnswer(client);
  printSent(client, mesh, options, seconds);
  std::string failure;
  try {
    watch(client, summary, options.seconds);
  } catch (const Error& error) {
    failure = error.what();
  }
  std::printf("%s", summary.text().c_str());
  if (options.json) std::printf("%s\n", summary.json().c_str());
  if (failure.empty() && summary.reports() == 0) failure = client.server() + " sent no reports";
  if (failure.empty() && !summary.firstError().empty())
    failure = client.server() + ": " + summary.firstError();
  if (failure.empty()) return 0;
  std::fflush(stdout);
  std::fprintf(stderr, "hapticd touch: %s\n", failure.c_str());
  return 1;
}

}  // namespace

void addTouch(CLI::App& app) {
  auto options = std::make_shared<TouchOptions>();
  CLI::App* command = app.add_subcommand(
      "touch", "Send a mesh (OBJ, STL, PLY, glTF) to a haptics server and show contact and force");
  const auto share = within(0, 1);
  command->add_option("mesh", options->mesh, "Mesh file")->required()->check(existingFile());
  command
      ->add_option("--server", options->server,
                   "NAME@host[:port], or NAME@tcp://host[:port] for a single TCP connection (firewalls)")
      ->capture_default_str();
  command->add_flag("--find", options->find, "Use the only server that 'hapticd list' finds on the network")
      ->excludes("--server");
  addTokenFile(*command, options->tokenFile);
  command->add_option("--seconds", options->seconds, "How long to watch; 0: until Ctrl-C")
      ->check(within(0, kLongest_s))
      ->capture_default_str();
  command->add_option("--stiffness", options->surface.stiffness, "0 to 1")
      ->check(share)
      ->capture_default_str();
  command->add_option("--damping", options->surface.damping, "0 to 1")->check(share)->capture_default_str();
  command->add_option("--static-friction", options->surface.staticFriction, "0 to 1")
      ->check(share)
      ->capture_default_str();
  command->add_option("--dynamic-friction", options->surface.dynamicFriction, "0 to 1")
      ->check(share)
      ->capture_default_str();
  command->add_option("--object", options->object, "Number of the object that gets the mesh")
      ->check(withinIntegers(0, kLastObject))
      ->capture_default_str();
  command
      ->add_option("--size-mm", options->size_mm, "Largest extent on the device in mm; 0: fit a small device")
      ->check(within(0, 1000))
      ->capture_default_str();
  command->add_flag("--true-size", options->trueSize, "One unit of the file is one millimetre of the device")
      ->excludes("--size-mm");
  command->add_flag("--replace", options->replace,
                    "Empty the whole scene first: all objects, effects and the workspace, of all clients.\n"
                    "Without it only the mesh of the object is replaced");
  command->add_flag("--keep-scene", options->keepScene)->group("");  // the default since 0.1
  command->add_flag("--json", options->json, "Also print the summary as one line of JSON, at the end");
  command->footer(
      "Exit status: 0 when done, 1 when the server cannot be reached, refuses something, disconnects or "
      "sends no\n"
      "reports.");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

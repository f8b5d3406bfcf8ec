// What clients can do to the loop, and to each other.
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "bench/all.h"
#include "bench/scenes.h"
#include "bench/server_process.h"
#include "bench/sockets.h"
#include "bench/tick_watcher.h"
#include "bench/timing.h"
#include "bench/witness.h"
#include "hapticd/client.h"
#include "wire/cookie.h"
#include "wire/messages.h"

namespace hapticd::bench {
namespace {

using namespace std::chrono_literals;

// Something that goes on until told to stop; never throws.
using Disturber = std::function<void(const ServerProcess& server, const std::atomic<bool>& stop)>;

void waitUntil(const std::atomic<bool>& stop) {
  while (!stop) std::this_thread::sleep_for(20ms);
}

void manyVertices(const ServerProcess& server, const std::atomic<bool>& stop) {
  static const std::vector<std::byte> bytes = vertexMessages(3'000'000);
  while (!stop) {
    Socket socket = Socket::connect(server.port());
    constexpr std::size_t kPiece = 1U << 20;
    for (std::size_t at = 0; at < bytes.size() && !stop; at += kPiece) {
      socket.sendAll(std::span(bytes).subspan(at, std::min(kPiece, bytes.size() - at)));
    }
  }
}

void newMeshes(const ServerProcess& server, const std::atomic<bool>& stop) {
  const geometry::TriangleMesh& mesh = bumpyBall(1'000'000);
  std::vector<std::array<float, 3>> vertices;
  for (const Vec3f& p : mesh.vertices) vertices.push_back({p.x(), p.y(), p.z()});
  Client client(server.device());
  client.subscribe(Reports::button);
  for (auto next = std::chrono::steady_clock::now(); !stop; next += 1s) {
    client.batch([&] {
      client.clearMesh(1);
      client.setObjectCount(2);
      client.setTransform(1, translation(0, 0, 500));
      client.uploadMesh(1, {vertices, mesh.triangles});
    });
    client.flushAll();
    while (!stop && std::chrono::steady_clock::now() < next + 1s) client.poll(20ms);
  }
}

void comingAndGoing(const ServerProcess& server, const std::atomic<bool>& stop) {
  const std::vector<std::byte> hello = greeting();
  while (!stop) {
    std::vector<Socket> clients;
    for (int i = 0; i < 255 && !stop; ++i) {
      clients.push_back(Socket::connect(server.port()));
      clients.back().sendAll(hello);
    }
    std::this_thread::sleep_for(100ms);
  }
}

void notReading(const ServerProcess& server, const std::atomic<bool>& stop) {
  Socket socket = Socket::connect(server.port(), 4096);
  socket.sendAll(greeting(wire::kReportAll, 1000));
  waitUntil(stop);
}

void halfACookie(const ServerProcess& server, const std::atomic<bool>& stop) {
  Socket socket = Socket::connect(server.port());
  const auto cookie = wire::encodeCookie(0);
  socket.sendAll(std::span(cookie).first(wire::kCookieBytes / 2));
  waitUntil(stop);
}

bool canRecord() {
  const WorkDirectory work;
  ChildProcess help(hapticdProgram(), {"serve", "--help"}, work / "log");
  help.wait();
  return help.output().find("--record") != std::string::npos;
}

// What a client saw of a server for a while, and what the machine did to a bare thread meanwhile.
struct Window {
  Watched client;
  std::uint64_t witnessLate = 0;
};

struct Phase {
  std::string what;
  Disturber disturb;
};

class Disturbance {
 public:
  explicit Disturbance(const Run& run)
      : run_(run), seconds_(run.seconds(4, 60, 60)), reason_(realtimeGranted() ? "" : "no SCHED_FIFO") {}

  void measure(const Phase& phase) {
    run_.progress(phase.what);
    ServerProcess server(handFile(20, static_cast<int>(Act::slide)));
    TickWatcher watcher(server.device());
    prepare(server);
    // The same server undisturbed, just before.
    const Window quiet = watch(watcher, seconds_);
    std::atomic<bool> stop{false};
    std::string failure;
    std::thread disturber([&] {
      // It stands for another machine: what it takes of this one's processors is not the server's doing.
      ::setpriority(PRIO_PROCESS, 0, 19);
      try {
        phase.disturb(server, stop);
      } catch (const std::exception& error) {
        if (!stop) failure = error.what();
      }
    });
    std::this_thread::sleep_for(200ms);
    const Window disturbed = watch(watcher, seconds_);
    stop = true;
    disturber.join();
    add(phase.what, quiet, disturbed, failure);
  }
  /// A server with these arguments beside one without, both undisturbed.
  void compare(const std::string& what, const std::vector<std::string>& arguments) {
    run_.progress(what);
    const Window without = alone({});
    add(what, without, alone(arguments), {});
  }
  Outcome take() { return std::move(outcome_); }
  void remark(const std::string& text) { outcome_.remarks.push_back(text); }

 private:
  static void prepare(const ServerProcess& server) {
    const geometry::TriangleMesh& mesh = bumpyBall(10'000);
    std::vector<std::array<float, 3>> vertices;
    for (const Vec3f& p : mesh.vertices) vertices.push_back({p.x(), p.y(), p.z()});
    Client client(server.device());
    // The object that others disturb is another one.
    client.setObjectCount(3);
    client.setSurfaceProperty(2, "stiffness", 0.5F);
    client.uploadMesh(2, {vertices, mesh.triangles});
    client.runFor(500ms);
  }

  Window alone(const std::vector<std::string>& arguments) const {
    const ServerProcess server(handFile(20, static_cast<int>(Act::slide)), arguments);
    TickWatcher watcher(server.device());
    prepare(server);
    return watch(watcher, seconds_);
  }

  static Window watch(TickWatcher& watcher, double seconds) {
    watcher.take();
    const Witness witness;
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    return {watcher.take(), witness.late()};
  }

  void add(const std::string& what, const Window& before, const Window& after, const std::string& failure) {
    const Watched& quiet = before.client;
    const Watched& disturbed = after.client;
    const auto count = [](std::uint64_t n) { return Summary::of(static_cast<double>(n)); };
    const std::string note = (failure.empty() ? "" : "the disturber ended: " + failure + "; ") +
                             std::to_string(disturbed.ticks) + " ticks heard of, " +
                             std::to_string(disturbed.lost) + " not (undisturbed " +
                             std::to_string(quiet.ticks) + ", " + std::to_string(quiet.lost) + ")";
    Row overruns{
        what + ": ticks over 0.5 ms late", "", count(disturbed.overruns), count(quiet.overruns), {}, note};
    overruns.checks.push_back({"overruns", static_cast<double>(disturbed.overruns),
                               static_cast<double>(std::max(quiet.overruns, after.witnessLate)), false,
                               reason_});
    const Row gap{what + ": longest gap between ticks", "ms", Summary::of(disturbed.longestGap_ms),
                  Summary::of(quiet.longestGap_ms),     {},   {}};
    Row latency{what + ": latency of another client", "us", disturbed.latency_us.summary(),
                quiet.latency_us.summary(),           {},   {}};
    latency.checks.push_back({"p99 ratio",
                              latency.yardstick->p99 > 0 ? latency.ours.p99 / latency.yardstick->p99 : 0, 2,
                              false, reason_});
    for (const Row& row : {overruns, witnessRow(after.witnessLate, before.witnessLate), gap, latency})
      outcome_.rows.push_back(row);
  }

  const Run& run_;
  double seconds_;
  std::string reason_;
  Outcome outcome_;
};

}  // namespace

Outcome measureDisturbance(const Run& run) {
  Disturbance disturbance(run);
  const std::vector<Phase> phases{{"(a) 3M setObjectVertex at full speed", manyVertices},
                                  {"(b) 1M triangles replaced every second", newMeshes},
                                  {"(c) 255 clients coming and going", comingAndGoing},
                                  {"(d) a client that stops reading", notReading},
                                  {"(e) half a cookie", halfACookie}};
  for (const Phase& phase : phases) disturbance.measure(phase);
  if (canRecord()) {
    const WorkDirectory work;
    disturbance.compare("(f) recording on, against a server that does not",
                        {"--record", (work / "record").string()});
  } else {
    disturbance.remark("(f) recording: this build of serve has no --record.");
  }
  return disturbance.take();
}

}  // namespace hapticd::bench

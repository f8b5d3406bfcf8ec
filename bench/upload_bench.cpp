// Meshes on their way into the server, against raw TCP of the same bytes.
#include <chrono>
#include <thread>

#include "bench/all.h"
#include "bench/helpers.h"
#include "bench/scenes.h"
#include "bench/sockets.h"
#include "bench/tick_watcher.h"
#include "bench/timing.h"
#include "hapticd/client.h"
#include "wire/cookie.h"
#include "wire/peer.h"

namespace hapticd::bench {
namespace {

using namespace std::chrono_literals;

double secondsSince(std::int64_t begin) {
  return static_cast<double>(nowNs() - begin) * 1e-9;
}

// Sends bytes to a process that reads and drops them; seconds until it says that it has all.
class RawSink {
 public:
  explicit RawSink(std::size_t bytes)
      : helper_({"sink", std::to_string(listener_.port()), std::to_string(bytes)}),
        socket_(listener_.accept()) {}
  double take(std::span<const std::byte> bytes) {
    const std::int64_t begin = nowNs();
    socket_.sendAll(bytes);
    std::array<std::byte, 1> answer{};
    if (!socket_.receiveAll(answer)) throw std::runtime_error("the raw sink is gone");
    return secondsSince(begin);
  }

 private:
  Listener listener_;
  Helper helper_;
  Socket socket_;
};

// Reads reports until one of this kind has come.
void waitFor(Socket& socket, wire::MessageKind kind) {
  std::vector<std::byte> bytes;
  std::array<std::byte, 4096> buffer{};
  bool greeted = false;
  for (;;) {
    const std::size_t got = socket.receive(buffer);
    if (got == 0) throw std::runtime_error("the server closed the connection");
    bytes.insert(bytes.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(got));
    if (!greeted && bytes.size() < wire::kCookieBytes) continue;
    const std::size_t skip = greeted ? 0 : wire::kCookieBytes;
    greeted = true;
    wire::FrameReader reader(wire::ByteView(bytes).subspan(skip));
    for (wire::FrameView frame; reader.next(frame);) {
      if (frame.header.type == wire::localType(kind).value) return;
    }
    bytes.assign(reader.rest().begin(), reader.rest().end());
  }
}

class Upload {
 public:
  explicit Upload(const Run& run) : run_(run), watcher_(server_.device()) {}

  Outcome measure() {
    byMessage("300k", 300'000, static_cast<int>(run_.seconds(3, 5, 9)));
    byMessage("3M", 3'000'000, static_cast<int>(run_.seconds(1, 3, 5)));
    byOurClient(300'000, static_cast<int>(run_.seconds(3, 5, 9)));
    inBulk(static_cast<int>(run_.seconds(2, 5, 9)));
    return std::move(outcome_);
  }

 private:
  /// Until the server has shown what it was sent and then nothing new for a while; seconds from `since` until
  /// the last of it was felt.
  double settle(std::int64_t since, std::chrono::milliseconds quiet = 300ms) {
    std::int64_t last = 0;
    for (auto left = 10'000ms; left > 0ms; left -= 100ms) {
      std::this_thread::sleep_for(100ms);
      const Watched seen = watcher_.take();
      if (seen.revisions == 0) continue;
      last = seen.lastRevision_ns;
      left = quiet + 100ms;
    }
    if (last == 0) throw std::runtime_error("the scene did not change within 10 s");
    return std::max(0.0, static_cast<double>(last - since) * 1e-9);
  }

  void startAnew() {
    Client client(server_.device());
    client.resetScene();
    client.setSurfaceProperty(0, "stiffness", 0.5F);
    client.flushAll();
    settle(nowNs());
  }

  void add(const std::string& what, std::size_t count, const Samples& ours_s, const Samples& raw_s,
           double floor) {
    const auto rate = [&](const Samples& s) {
      return Summary::of(static_cast<double>(count) * 1e-6 / s.summary().p50);
    };
    Row row{what, "M/s", rate(ours_s), rate(raw_s), {}, {}};
    row.checks.push_back({"M vertices/s", row.ours.p50, floor, true, {}});
    if (floor > 5) {
      // Either is enough.
      const Check slower{"times the raw time",
                         raw_s.summary().p50 > 0 ? ours_s.summary().p50 / raw_s.summary().p50 : 0, 3};
      if (slower.met()) row.checks = {slower};
    }
    outcome_.rows.push_back(row);
  }

  void byMessage(const std::string& name, std::size_t count, int rounds) {
    run_.progress(name + " vertices by one message each");
    std::vector<std::byte> bytes = vertexMessages(count);
    RawSink raw(bytes.size());
    Samples ours_s, raw_s, touchable_s;
    for (int round = 0; round < rounds; ++round) {
      startAnew();
      Socket socket = Socket::connect(server_.port());
      // Names first, so that the question behind the mesh is understood by the same connection.
      const std::int64_t begin = nowNs();
      socket.sendAll(bytes);
      const std::int64_t sent = nowNs();
      socket.sendAll(question());
      waitFor(socket, wire::kindOf<wire::TrackerToRoom>);
      ours_s.add(secondsSince(begin));
      // Rebuilding takes a quarter of the time: the last part may come late.
      touchable_s.add(settle(sent, 2500ms));
      raw_s.add(raw.take(bytes));
    }
    add(name + " vertices by one message each, encoded before", count, ours_s, raw_s, 5);
    if (count < 3'000'000) return;
    Row row{"1M triangles by message: all touchable after the last byte",
            "s",
            touchable_s.summary(),
            std::nullopt,
            {},
            {}};
    row.checks.push_back({"p50 s", row.ours.p50, 0.5});
    outcome_.rows.push_back(row);
  }

  // What asks for an answer, as bytes that follow a greeting.
  static std::vector<std::byte> question() {
    wire::FrameEncoder encoder;
    // "Phantom" is the first name that our greeting describes.
    encoder.add({}, wire::LocalSender{0}, wire::TrackerRequestToRoom{});
    return {encoder.bytes().begin(), encoder.bytes().end()};
  }

  void byOurClient(std::size_t count, int rounds) {
    run_.progress("vertices by our client's setVertex");
    RawSink raw(vertexMessages(count).size());
    const std::vector<std::byte> bytes = vertexMessages(count);
    Samples ours_s, raw_s;
    for (int round = 0; round < rounds; ++round) {
      startAnew();
      Client client(server_.device());
      client.subscribe(Reports::button);
      bool answered = false;
      client.onToRoom([&](const ToRoomReport&) { answered = true; });
      const std::int64_t begin = nowNs();
      for (std::size_t i = 0; i < count; ++i) {
        client.setVertex(0, static_cast<int>(i), static_cast<float>(i % 100), static_cast<float>(i % 71), 0);
      }
      client.requestToRoom();
      client.flushAll();
      while (!answered) client.poll(1s);
      ours_s.add(secondsSince(begin));
      settle(nowNs());
      raw_s.add(raw.take(bytes));
    }
    add("300k vertices by our client's setVertex", count, ours_s, raw_s, 5);
  }

  void inBulk(int rounds) {
    run_.progress("in bulk");
    const geometry::TriangleMesh& mesh = bumpyBall(1'000'000);
    std::vector<std::array<float, 3>> corners;
    for (const auto& triangle : mesh.triangles) {
      for (const std::uint32_t v : triangle) {
        const Vec3f& p = mesh.vertices[v];
        corners.push_back({p.x(), p.y(), p.z()});
      }
    }
    const std::vector<std::byte> bytes(corners.size() * sizeof(corners[0]));
    RawSink raw(bytes.size());
    Samples ours_s, raw_s, touchable_s;
    for (int round = 0; round < rounds; ++round) {
      startAnew();
      ours_s.add(bulkRound(corners));
      settle(nowNs());
      raw_s.add(raw.take(bytes));
      startAnew();
      touchable_s.add(meshRound(mesh));
    }
    add("3M corners in bulk by our client", corners.size(), ours_s, raw_s, 30);
    Row row{"1M triangles in bulk: touchable after the last byte",
            "s",
            touchable_s.summary(),
            std::nullopt,
            {},
            {}};
    row.checks.push_back({"p50 s", row.ours.p50, 0.5});
    outcome_.rows.push_back(row);
  }

  double bulkRound(const std::vector<std::array<float, 3>>& corners) {
    Client client(server_.device());
    client.subscribe(Reports::button);
    bool answered = false;
    client.onToRoom([&](const ToRoomReport&) { answered = true; });
    const std::int64_t begin = nowNs();
    client.uploadCorners(0, corners);
    client.requestToRoom();
    client.flushAll();
    while (!answered) client.poll(1s);
    return secondsSince(begin);
  }

  double meshRound(const geometry::TriangleMesh& mesh) {
    std::vector<std::array<float, 3>> vertices;
    for (const Vec3f& p : mesh.vertices) vertices.push_back({p.x(), p.y(), p.z()});
    Client client(server_.device());
    client.uploadMesh(0, {vertices, mesh.triangles});
    return settle(nowNs());
  }

  const Run& run_;
  ServerProcess server_;
  TickWatcher watcher_;
  Outcome outcome_;
};

}  // namespace

Outcome measureUpload(const Run& run) {
  return Upload(run).measure();
}

}  // namespace hapticd::bench

// The HTTP port of a whole server, over real sockets.
#include "server/web/web_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <future>

#include "exposition.h"
#include "feeling.h"
#include "http_client.h"

namespace hapticd::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

#ifdef HAPTICD_SANITIZED
constexpr int kMany = 150;
constexpr std::int32_t kSide = 120;
#else
constexpr int kMany = 2000;
constexpr std::int32_t kSide = 708;  // a million triangles
#endif

class Web : public testing::Test {
 protected:
  net::Endpoint web() { return *server_.server().webAddress(); }
  json stateWhenTriangles(std::int64_t object, std::int64_t count) {
    return stateWhen(web(), [&](const json& state) {
      const json& objects = state["scenes"][0]["objects"];
      for (const json& o : objects) {
        if (o["id"] == object) return o["triangles"] == count;
      }
      return false;
    });
  }
  Answer mesh(const json& object, int scene = 0) {
    const std::string target = "/api/mesh?scene=" + std::to_string(scene) + "&object=" + object["id"].dump() +
                               "&geometry=" + object["geometry"].dump();
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(200);
    for (;;) {
      Answer answer = get(web(), target);
      if (answer.status != 503 || std::chrono::steady_clock::now() > end) return answer;
      EXPECT_EQ(answer.header("Retry-After"), "1");
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  RunningServer server_{withWeb()};
};

std::uint32_t numberAt(const std::string& bytes, std::size_t at) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

std::vector<std::string> keysOf(const json& object) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : object.items()) keys.push_back(key);
  return keys;
}

TEST_F(Web, TheStateHasEveryFieldThePageReads) {
  ScriptedPeer peer(server_.address());
  ASSERT_TRUE(peer.untilConnected());
  sendCube(peer);
  wire::Effect spring{.type = "spring",
                      .index = 3,
                      .gain = 0.1,
                      .magnitude = 1,
                      .duration = 2000,
                      .frequency = 0,
                      .position = {1, 2, 3},
                      .direction = {0, 1, 0}};
  peer.send(wire::SetObjectName{0, "a cube"});
  peer.send(spring);
  peer.send(wire::Plane{.plane = {0, 1, 0, 0.05F},
                        .stiffness = 0.5F,
                        .damping = 0,
                        .dynamicFriction = 0,
                        .staticFriction = 0,
                        .index = 0,
                        .recoveryCycles = 1});
  peer.send(wire::ConstraintMode{1});
  peer.send(wire::ConstraintPoint{{0.01F, 0, 0}});
  peer.send(wire::ConstraintStiffness{100});
  peer.send(wire::ConstraintEnable{1});
  ASSERT_TRUE(untilApplied(peer));
  const json state = stateWhenTriangles(0, 12);
  ASSERT_FALSE(state.is_null());

  EXPECT_EQ(state["server"]["version"].get<std::string>().empty(), false);
  EXPECT_GT(state["server"]["uptime_s"], 0);
  EXPECT_NE(state["server"]["run"].get<std::string>(), "");
  EXPECT_TRUE(state["server"]["recording"].is_null());

  const json& device = state["devices"].at(0);
  EXPECT_EQ(device["name"], "Phantom");
  EXPECT_EQ(device["names"], json::array({"Phantom"}));
  EXPECT_EQ(device["driver"], "simulated");
  EXPECT_EQ(device["simulated"], true);
  EXPECT_EQ(device["scene"], 0);
  EXPECT_EQ(device["workspace_m"]["min"], json::array({-0.08, -0.06, -0.035}));
  EXPECT_EQ(device["T_world_device"],
            json::array({1000., 0., 0., 0., 0., 1000., 0., 0., 0., 0., 1000., 0., 0., 0., 0., 1.}));
  EXPECT_EQ(device["world_per_reported"], 1000);
  EXPECT_EQ(device["peak_force_N"], 3.3);
  EXPECT_EQ(device["rate_Hz"], 1000);
  EXPECT_TRUE(device["realtime"].is_boolean());
  EXPECT_EQ(device["hand"], "scripted");
  EXPECT_TRUE(device["held_by"].is_null());
  EXPECT_EQ(device["fault"], "");
  EXPECT_FALSE(device.contains("temperature_C"));
  EXPECT_EQ(device["guard"]["armed"], true);
  EXPECT_EQ(device["guard"]["stopped"], false);
  EXPECT_TRUE(device["guard"]["active"].is_array());
  EXPECT_GT(device["loop"]["ticks"], 0);
  for (const char* name : {"period_us", "wakeup_us", "compute_us"}) {
    const json& histogram = device["loop"][name];
    EXPECT_LE(histogram["p50"], histogram["p99"]);
    EXPECT_LE(histogram["p999"], histogram["max"]);
    std::uint64_t sum = 0;
    for (const json& bin : histogram["bins"]) sum += bin.at(1).get<std::uint64_t>();
    EXPECT_GT(sum, 0u) << name;
  }

  const json& client = state["clients"].at(0);
  EXPECT_THAT(keysOf(client),
              testing::IsSupersetOf({"id", "address", "mode", "devices", "connected_s", "rate_Hz", "bytes_in",
                                     "bytes_out", "dropped", "queued_bytes", "commands"}));
  EXPECT_EQ(client["mode"], "tcp");
  EXPECT_EQ(client["devices"], json::array({"Phantom"}));
  EXPECT_EQ(client["rate_Hz"], 1000);
  EXPECT_EQ(client["commands"], true);
  EXPECT_GT(client["bytes_in"], 1000);

  const json& scene = state["scenes"].at(0);
  EXPECT_EQ(scene["devices"], json::array({"Phantom"}));
  EXPECT_GT(scene["revision"], 0);
  const json& object = scene["objects"].at(0);
  EXPECT_EQ(object["id"], 0);
  EXPECT_EQ(object["name"], "a cube");
  EXPECT_EQ(object["parent"], -1);
  EXPECT_EQ(object["touchable"], true);
  EXPECT_EQ(object["vertices"], 36);
  EXPECT_EQ(object["display_triangles"], 12);
  EXPECT_GT(object["geometry"], 0);
  EXPECT_EQ(object["T_world_object"].size(), 16u);
  EXPECT_EQ(object["T_object_mesh"].size(), 16u);
  EXPECT_EQ(object["stiffness_N_per_m"], 500);
  for (const char* name :
       {"damping_Ns_per_m", "static_friction", "dynamic_friction", "popthrough", "mass_kg"}) {
    EXPECT_EQ(object[name], 0) << name;
  }
  EXPECT_EQ(scene["vibration_contact_unit"], "rad/s");
  EXPECT_EQ(scene["surface_at_1"]["stiffness_N_per_m"], 500);
  const json& effect = scene["effects"].at(0);
  EXPECT_EQ(effect["index"], 3);
  EXPECT_EQ(effect["type"], "spring");
  EXPECT_EQ(effect["active"], false);
  EXPECT_EQ(effect["duration_ms"], 2000);
  EXPECT_EQ(effect["position"], json::array({1., 2., 3.}));
  const json& plane = scene["planes"].at(0);
  EXPECT_EQ(plane["index"], 0);
  EXPECT_EQ(plane["plane"].at(1), 1);
  EXPECT_NEAR(plane["plane"].at(3).get<double>(), 50, 1e-5) << "world units";
  EXPECT_EQ(plane["stiffness_N_per_m"], 500);
  EXPECT_EQ(scene["constraint"]["mode"], "point");
  EXPECT_NEAR(scene["constraint"]["point"].at(0).get<double>(), 10, 1e-5);
  EXPECT_EQ(scene["fields"], json::array());
}

TEST_F(Web, ListsAnUntouchableChildWithItsPose) {
  ScriptedPeer peer(server_.address());
  ASSERT_TRUE(peer.untilConnected());
  sendCube(peer);
  peer.send(wire::AddObject{1, 0});
  sendCube(peer, 1);
  peer.send(wire::SetObjectIsTouchable{1, 0});
  peer.send(wire::SetTransformMatrix{1, {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1}});
  const json state = stateWhenTriangles(1, 12);
  ASSERT_FALSE(state.is_null());
  const json& child = state["scenes"][0]["objects"].at(1);
  EXPECT_EQ(child["parent"], 0);
  EXPECT_EQ(child["touchable"], false);
  EXPECT_EQ(child["T_world_object"],
            json::array({2e3, 0., 0., 0., 0., 2e3, 0., 0., 0., 0., 2e3, 0., 5e3, 6e3, 7e3, 1.}))
      << "an added object is a stock one, in metres";
  EXPECT_EQ(child["T_parent_object"],
            json::array({2., 0., 0., 0., 0., 2., 0., 0., 0., 0., 2., 0., 5., 6., 7., 1.}));
}

TEST_F(Web, ServesTheMeshAndNumbersItsShapes) {
  ScriptedPeer peer(server_.address());
  ASSERT_TRUE(peer.untilConnected());
  sendCube(peer);
  const json before = stateWhenTriangles(0, 12);
  const json& object = before["scenes"][0]["objects"][0];
  const Answer answer = mesh(object);
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.header("Content-Type"), "application/octet-stream");
  ASSERT_EQ(answer.body.substr(0, 4), "HDM1");
  ASSERT_EQ(numberAt(answer.body, 4), 36u);
  ASSERT_EQ(numberAt(answer.body, 8), 12u);
  ASSERT_EQ(answer.body.size(), 16u + 36 * 12 + 12 * 12);
  const std::vector<Vec3f> corners = boxTriples(Vec3f::Constant(20));
  for (std::size_t i = 0; i < 36; ++i) {
    const std::uint32_t vertex = numberAt(answer.body, 16 + 36 * 12 + 4 * i);
    Vec3f at;
    std::memcpy(at.data(), answer.body.data() + 16 + 12 * vertex, 12);
    EXPECT_EQ(at, corners[i]);
  }
  // Moving an object does not change its shape.
  peer.send(wire::SetObjectPosition{0, {0.01F, 0, 0}});
  ASSERT_TRUE(untilApplied(peer));
  const json moved = stateWhenTriangles(0, 12);
  EXPECT_EQ(moved["scenes"][0]["objects"][0]["geometry"], object["geometry"]);
  sendVertices(peer, 0, boxTriples(Vec3f::Constant(15)));
  const json after = stateWhen(web(), [&](const json& state) {
    return state["scenes"][0]["objects"][0]["geometry"] != object["geometry"];
  });
  ASSERT_FALSE(after.is_null());
  const Answer old = get(web(), "/api/mesh?scene=0&object=0&geometry=" + object["geometry"].dump());
  EXPECT_EQ(old.status, 404);
  EXPECT_THAT(old.json()["error"].get<std::string>(), HasSubstr("now, not"));
  EXPECT_EQ(mesh(after["scenes"][0]["objects"][0]).status, 200);
}

TEST_F(Web, ExplainsWhyThereIsNoMesh) {
  const auto error = [&](const std::string& query, int status) {
    const Answer answer = get(web(), "/api/mesh" + query);
    EXPECT_EQ(answer.status, status) << query;
    EXPECT_EQ(answer.header("Content-Type"), "application/json");
    return answer.json()["error"].get<std::string>();
  };
  EXPECT_THAT(error("?scene=0&object=7&geometry=1", 404), HasSubstr("there is no object 7 of scene 0"));
  EXPECT_THAT(error("?scene=0&object=0&geometry=1", 404), HasSubstr("has no triangles"));
  EXPECT_THAT(error("?scene=3&object=0&geometry=1", 404), HasSubstr("there is no scene 3"));
  for (const char* query :
       {"", "?scene=0", "?scene=0&object=x&geometry=1", "?scene=-1&object=0&geometry=1",
        "?scene=0&object=0&geometry=99999999999999999999", "?scene=0&object=0&geometry=1%00"}) {
    EXPECT_THAT(error(query, 400), HasSubstr("/api/mesh?scene=0&object=0&geometry=1")) << query;
  }
  EXPECT_THAT(error("?scene=0&geometry=1", 400), HasSubstr("object is missing"));
  EXPECT_THAT(error("?scene=0&object=\"x\\&geometry=1", 400),
              HasSubstr("object must be a whole number, got '\"x\\'"));
  EXPECT_THAT(error("?scene=0&object=0&geometry=" + std::string(3000, '9'), 400),
              testing::SizeIs(testing::Lt(250)));
}

// One large grid in bulk messages.
void sendGrid(ScriptedPeer& peer) {
  std::vector<float> positions;
  std::vector<std::int32_t> corners;
  for (std::int32_t i = 0; i <= kSide; ++i) {
    for (std::int32_t j = 0; j <= kSide; ++j) {
      const float u = static_cast<float>(i) / kSide, v = static_cast<float>(j) / kSide;
      positions.insert(positions.end(), {80 * u - 40, 5 * u * v, 80 * v - 40});
    }
  }
  for (std::int32_t i = 0; i < kSide; ++i) {
    for (std::int32_t j = 0; j < kSide; ++j) {
      const std::int32_t a = i * (kSide + 1) + j, b = a + kSide + 1;
      corners.insert(corners.end(), {a, a + 1, b, a + 1, b + 1, b});
    }
  }
  constexpr std::ptrdiff_t kRun = 3 * 5000;
  peer.queue(wire::BatchBegin{});
  const auto send = [&]<class M, class T>(M message, const std::vector<T>& all, auto member) {
    for (std::ptrdiff_t at = 0; at < std::ssize(all); at += kRun) {
      message.first = static_cast<std::int32_t>(at / 3);
      (message.*member).values.assign(all.begin() + at, all.begin() + std::min(at + kRun, std::ssize(all)));
      peer.send(message);
      if (!peer.until([&] { return peer.connection().statistics().queuedBytes < 1 << 20; })) return;
    }
  };
  send(wire::MeshVertices{}, positions, &wire::MeshVertices::positions);
  send(wire::MeshTriangles{}, corners, &wire::MeshTriangles::vertices);
  peer.queue(wire::SetHapticProperty{0, "stiffness", 1.0F});
  peer.send(wire::BatchCommit{});
  peer.until([&] { return peer.connection().statistics().queuedBytes == 0; });
}

TEST_F(Web, SimplifiesAMillionTrianglesToAHundredThousandWithoutDelayingOtherRequests) {
  ScriptedPeer peer(server_.address());
  ASSERT_TRUE(peer.untilConnected());
  sendGrid(peer);
  const json state = stateWhenTriangles(0, 2 * kSide * kSide);
  ASSERT_FALSE(state.is_null());
  const json& object = state["scenes"][0]["objects"][0];
  EXPECT_LE(object["display_triangles"], 100'000);
  // While the worker simplifies the mesh, the server responds to other requests.
  std::atomic<bool> done{false};
  Answer answer;
  std::thread asker([&] {
    answer = mesh(object);
    done = true;
  });
  int meanwhile = 0;
  while (!done) {
    EXPECT_EQ(get(web(), "/api/messages").status, 200);
    meanwhile += done ? 0 : 1;
  }
  asker.join();
  EXPECT_GT(meanwhile, 0);
  ASSERT_EQ(answer.status, 200) << answer.body;
  const std::uint32_t shown = numberAt(answer.body, 8);
  EXPECT_LE(shown, 100'000u);
  EXPECT_GE(shown, std::min(2 * kSide * kSide, 30'000));
  EXPECT_EQ(get(web(), "/api/state").json()["scenes"][0]["objects"][0]["display_triangles"], shown);
}

TEST_F(Web, RefusesForeignNamesAndOriginsOnEveryPath) {
  for (const char* target : {"/", "/viewer.js", "/api/state", "/api/mesh?scene=0&object=0&geometry=1",
                             "/metrics", "/api/messages", "/api/servers", "/vrpn", "/nothing"}) {
    EXPECT_EQ(get(web(), target, "Host: evil.example\r\n").status, 403) << target;
    EXPECT_EQ(get(web(), target, "Origin: http://evil.example\r\n").status, 403) << target;
    EXPECT_EQ(get(web(), target, "Origin: null\r\n").status, 403) << target;
  }
  const std::string upgrade =
      "GET /vrpn HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade, close\r\nSec-WebSocket-Version: "
      "13\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
  EXPECT_EQ(ask(web(), upgrade + "Host: " + web().text() + "\r\nOrigin: http://evil.example\r\n\r\n").status,
            403);
  EXPECT_EQ(ask(web(), upgrade + "Host: evil.example\r\n\r\n").status, 403);
  const Answer refused = get(web(), "/api/state", "Origin: http://evil.example\r\n");
  EXPECT_EQ(refused.body, "pages from \"http://evil.example\" may not use this server\n");
  EXPECT_EQ(refused.header("Access-Control-Allow-Origin"), "");
  const std::string ours = "http://" + web().text();
  const Answer allowed = get(web(), "/api/state", "Origin: " + ours + "\r\n");
  EXPECT_EQ(allowed.status, 200);
  EXPECT_EQ(allowed.header("Access-Control-Allow-Origin"), ours);
  EXPECT_EQ(get(web(), "/api/state").header("Access-Control-Allow-Origin"), "");
}

TEST_F(Web, ARequestWithoutANameOrWithTwoIsMalformed) {
  const std::string host = "Host: " + web().text() + "\r\n";
  for (const std::string& hosts : {std::string(), host + host}) {
    EXPECT_EQ(ask(web(), "GET /healthz HTTP/1.1\r\nConnection: close\r\n" + hosts + "\r\n").status, 400);
  }
}

TEST_F(Web, AWholeAddressIsJudgedByItsName) {
  const std::string rest = "/healthz HTTP/1.1\r\nConnection: close\r\nHost: ";
  EXPECT_EQ(ask(web(), "GET http://" + web().text() + rest + web().text() + "\r\n\r\n").status, 200);
  EXPECT_EQ(ask(web(), "GET http://" + web().text() + rest + "proxy.example\r\n\r\n").status, 200);
  for (const std::string& name : {std::string("evil.example"), web().text() + "@evil.example",
                                  "evil.example@" + web().text(), std::string()}) {
    EXPECT_EQ(ask(web(), "GET http://" + name + rest + web().text() + "\r\n\r\n").status, 403) << name;
  }
}

TEST_F(Web, AllowsOnlyGetAndHead) {
  const std::string rest = " HTTP/1.1\r\nHost: " + web().text() + "\r\nConnection: close\r\n\r\n";
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS"}) {
    const Answer answer = ask(web(), std::string(method) + " /api/state" + rest);
    EXPECT_EQ(answer.status, 405) << method;
    EXPECT_EQ(answer.header("Allow"), "GET, HEAD");
  }
  EXPECT_EQ(ask(web(), "GET ftp://" + web().text() + "/" + rest).status, 400);
  const Answer head = ask(web(), "HEAD /api/state" + rest);
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.body, "");
}

TEST_F(Web, ServesThePageWithSecurityHeaders) {
  const Answer page = get(web(), "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.header("Content-Type"), "text/html; charset=utf-8");
  EXPECT_EQ(page.header("Cache-Control"), "no-cache");
  EXPECT_THAT(page.header("Content-Security-Policy"), HasSubstr("default-src 'self';"));
  EXPECT_EQ(page.header("X-Content-Type-Options"), "nosniff");
  EXPECT_THAT(page.body, HasSubstr("<title>hapticd"));
  EXPECT_EQ(get(web(), "/index.html").body, page.body);
  for (const char* nowhere :
       {"/nothing", "/../etc/passwd", "/%2e%2e/etc/passwd", "//etc/passwd", "/vrpn/", "/api"}) {
    EXPECT_EQ(get(web(), nowhere).status, 404) << nowhere;
  }
  EXPECT_EQ(get(web(), "/vrpn").status, 426);
}

TEST_F(Web, HealthIsOkWhileAllDevicesWork) {
  const Answer answer = get(web(), "/healthz");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, "ok\n");
}

TEST_F(Web, ListsTheMessagesOfTheWire) {
  const json messages = get(web(), "/api/messages").json()["messages"];
  ASSERT_EQ(messages.size(), wire::kMessageKinds);
  const auto& info = wire::info(wire::kindOf<wire::HoldHand>);
  const json& hold = messages.at(static_cast<std::size_t>(wire::kindOf<wire::HoldHand>));
  EXPECT_EQ(hold["name"], info.name);
  EXPECT_EQ(hold["to_server"], true);
  EXPECT_EQ(hold["to_client"], false);
}

TEST_F(Web, MetricsAreWellFormedAndCurrent) {
  ScriptedPeer peer(server_.address());
  ASSERT_TRUE(peer.untilConnected());
  sendCube(peer);
  ASSERT_FALSE(stateWhenTriangles(0, 12).is_null());
  const Answer answer = get(web(), "/metrics");
  EXPECT_EQ(answer.header("Content-Type"), "text/plain; version=0.0.4; charset=utf-8");
  const Exposition metrics(answer.body);
  EXPECT_EQ(metrics.problems(), std::vector<std::string>{});
  EXPECT_GT(metrics.value("hapticd_ticks_total{device=\"Phantom\"}"), 0);
  EXPECT_GT(metrics.value("hapticd_tick_compute_seconds_count{device=\"Phantom\"}"), 0);
  EXPECT_EQ(metrics.value("hapticd_scene_triangles{scene=\"0\"}"), 12);
  EXPECT_EQ(metrics.value("hapticd_clients"), 1);
  EXPECT_GT(metrics.value("hapticd_client_sent_bytes_total{client=\"1\",address=\"" +
                          peer.connection().local().text() + "\",mode=\"tcp\"}"),
            0);
  const Exposition later(get(web(), "/metrics").body);
  EXPECT_GT(later.value("hapticd_ticks_total{device=\"Phantom\"}"),
            metrics.value("hapticd_ticks_total{device=\"Phantom\"}"));
}

TEST_F(Web, ThousandsOfRequestsLeakNoDescriptors) {
  const auto openFiles = [] {
    const std::filesystem::directory_iterator files("/proc/self/fd");
    return std::distance(begin(files), end(files));
  };
  const char* targets[] = {"/api/state", "/metrics", "/", "/nothing",
                           "/api/mesh?scene=0&object=9&geometry=1"};
  for (const char* target : targets) get(web(), target);
  const auto before = openFiles();
  for (int i = 0; i < kMany; ++i) ASSERT_NE(get(web(), targets[i % 5]).status, 0) << i;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (openFiles() > before && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_LE(openFiles(), before);
}

TEST_F(Web, ReportsSeveralDevicesAndScenes) {
  server::ServerConfig config = withWeb();
  config.devices.resize(3, config.devices.front());
  config.devices[0].names = {"Left", "Tracker0"};
  config.devices[1].names = {"Right"};
  config.devices[2].names = {"Other"};
  config.devices[0].scene = config.devices[1].scene = "shared";
  RunningServer several(config);
  const json state = get(*several.server().webAddress(), "/api/state").json();
  EXPECT_EQ(state["devices"][0]["names"], json::array({"Left", "Tracker0"}));
  EXPECT_EQ(state["devices"][1]["scene"], 0);
  EXPECT_EQ(state["devices"][2]["scene"], 1);
  EXPECT_EQ(state["scenes"][0]["devices"], json::array({"Left", "Right"}));
  EXPECT_EQ(state["scenes"][1]["devices"], json::array({"Other"}));
}

TEST(WebPort, AConfiguredPortThatIsInUseIsAnError) {
  RunningServer first(withWeb());
  server::ServerConfig config = RunningServer::anyPort();
  config.http = first.server().webAddress()->text();
  try {
    const server::Server second(config);
    FAIL() << "two servers on one port";
  } catch (const net::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("choose another with --http"));
  }
}

TEST(WebPort, ADefaultPortThatIsInUseIsNotAnError) {
  net::Loop loop;
  std::unique_ptr<net::TcpListener> other;
  try {
    other = std::make_unique<net::TcpListener>(loop, net::Endpoint{net::kLoopbackAddress, 8080}, nullptr);
  } catch (const net::Error&) {
    GTEST_SKIP() << "another process has port 8080 and may release it at any time";
  }
  server::ServerConfig config = RunningServer::anyPort();
  config.http = server::kHttpAuto;
  RunningServer server(config);
  EXPECT_EQ(server.server().webAddress(), std::nullopt);
}

/// Finds one server when the test allows it, or at its own end.
class SlowFinder final : public server::ServerFinder {
 public:
  explicit SlowFinder(std::shared_future<void> allowed) : allowed_(std::move(allowed)) {}
  ~SlowFinder() override {
    ending_ = true;
    if (thread_.joinable()) thread_.join();
  }
  void find(Done done) override {
    if (thread_.joinable()) thread_.join();
    thread_ = std::thread([this, done = std::move(done)] {
      while (!ending_ && allowed_.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
      }
      done({.servers = {{.name = "attic", .page = "http://10.0.0.9:8080/"}}});
    });
  }

 private:
  std::shared_future<void> allowed_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

TEST(WebPort, ListsTheServersOfTheNetworkAndAnswersOtherRequestsMeanwhile) {
  std::promise<void> allow;
  RunningServer server(withWeb(), std::make_unique<SlowFinder>(allow.get_future().share()));
  const net::Endpoint web = *server.server().webAddress();
  std::vector<std::future<Answer>> askers;
  for (int i = 0; i < 10; ++i)
    askers.push_back(std::async(std::launch::async, [web] { return get(web, "/api/servers"); }));
  for (int i = 0; i < 100; ++i) EXPECT_EQ(get(web, "/api/state").status, 200);
  for (const auto& asker : askers)
    EXPECT_EQ(asker.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  allow.set_value();
  for (auto& asker : askers) {
    const Answer answer = asker.get();
    EXPECT_EQ(answer.status, 200);
    EXPECT_EQ(answer.header("Content-Type"), "application/json");
    EXPECT_EQ(answer.json()["servers"].at(0)["name"], "attic");
  }
}

TEST(WebPort, AServerEndsWhileItSearchesTheNetwork) {
  std::promise<void> never;
  std::optional<net::RawSocket> asker;
  {
    RunningServer server(withWeb(), std::make_unique<SlowFinder>(never.get_future().share()));
    const net::Endpoint web = *server.server().webAddress();
    asker.emplace(net::RawSocket::connected(web));
    asker->send("GET /api/servers HTTP/1.1\r\nHost: " + web.text() + "\r\n\r\n");
    EXPECT_EQ(get(web, "/api/state").status, 200);
  }
  EXPECT_EQ(asker->receiveSome(), "") << "closed";
}

TEST(WebPort, AServerThatCannotSearchGivesTheReason) {
  RunningServer server(withWeb());
  const json found = get(*server.server().webAddress(), "/api/servers").json();
  EXPECT_EQ(found["servers"], json::array());
  EXPECT_NE(found["reason"], "");
}

TEST(WebPort, CanBeDisabled) {
  RunningServer server;
  EXPECT_EQ(server.server().webAddress(), std::nullopt);
}

}  // namespace
}  // namespace hapticd::test

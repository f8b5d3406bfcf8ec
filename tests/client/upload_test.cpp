// Uploads of meshes to servers that are fast, slow or lost.
#include "client/client_tests.h"

#include <thread>

namespace hapticd::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

#ifdef HAPTICD_SANITIZED
constexpr std::size_t kManyVertices = 9999;
#else
constexpr std::size_t kManyVertices = 99999;
#endif

TEST_P(BothWays, AHundredThousandVerticesArriveInOrder) {
  ScriptedServer server;
  Client client(name(server));
  std::vector<std::array<float, 3>> corners(kManyVertices);
  for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = {static_cast<float>(i), 1, -2};
  std::vector<std::uint64_t> progress;
  std::uint64_t total = 0;
  client.uploadCorners(3, corners, [&](const UploadProgress& p) {
    progress.push_back(p.bytesSent);
    total = p.bytesTotal;
  });
  ASSERT_FALSE(progress.empty());
  EXPECT_TRUE(std::is_sorted(progress.begin(), progress.end()));
  EXPECT_EQ(total, corners.size() * 48);
  EXPECT_EQ(progress.back(), total);
  EXPECT_GE(client.statistics().tcpBytesOut, total) << "the system has accepted all of it";

  const auto vertices = server.waitVertices(corners.size());
  ASSERT_EQ(vertices.size(), corners.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    ASSERT_EQ(vertices[i].vertex, static_cast<std::int32_t>(i));
    ASSERT_EQ(vertices[i].object, 3);
    ASSERT_EQ(vertices[i].position, corners[i]);
  }
}

// Reports that nobody has read make the system reset the connection and drop what it has not sent.
TEST_P(BothWays, WhatWasSentArrivesAlthoughTheClientEnds) {
  ScriptedServer server;
  const std::vector<std::array<float, 3>> corners(kManyVertices);
  std::thread resume;
  {
    Client client(name(server), {.queueLimit_bytes = std::size_t{1} << 30});
    server.stopReading();
    for (const auto& corner : corners) client.setVertex(0, 0, corner[0], corner[1], corner[2]);
    client.setTouchable(0, true);  // collected, and not sent yet
    server.send(wire::TouchedObject{1});
    resume = std::thread([&] {
      std::this_thread::sleep_for(1500ms);
      server.send(wire::TouchedObject{2});
      server.startReading();
    });
  }
  resume.join();
  EXPECT_EQ(server.waitVertices(corners.size()).size(), corners.size());
  EXPECT_EQ(server.waitReceived(1).size(), 1U);
}

TEST(Client, AServerThatHasStoppedDoesNotKeepAClientThatEnds) {
  for (const int vertices : {1, 200'000}) {  // the server's system takes all, or not
    ScriptedServer server;
    std::optional<Client> client;
    client.emplace(server.tcpName(),
                   ClientOptions{.sendTimeout = 1500ms, .queueLimit_bytes = std::size_t{1} << 30});
    server.stopReading();
    for (int i = 0; i < vertices; ++i) client->setVertex(0, i, 0, 0, 0);
    const auto start = std::chrono::steady_clock::now();
    client.reset();
    EXPECT_LT(std::chrono::steady_clock::now() - start, kPatience) << "it would wait for ever";
  }
}

TEST(Client, MeshesAreSentCornerByCorner) {
  ScriptedServer server;
  Client client(server.tcpName());
  const std::vector<std::array<float, 3>> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<std::array<std::uint32_t, 3>> triangles{{0, 1, 2}, {3, 2, 1}};
  client.uploadMesh(0, {vertices, triangles});
  const auto received = server.waitVertices(6);
  ASSERT_EQ(received.size(), 6U);
  EXPECT_EQ(received[3].position, vertices[3]);
  EXPECT_EQ(received[5].vertex, 5);
  EXPECT_EQ(received[5].position, vertices[1]);

  const std::vector<std::array<std::uint32_t, 3>> bad{{0, 1, 2}, {3, 4, 1}};
  EXPECT_THAT(textOf<std::invalid_argument>([&] {
                client.uploadMesh(0, {vertices, bad});
              }),
              HasSubstr("triangle 1 names vertex 4, the mesh has 4"));
}

TEST(Client, CommandsSleepAndThenFailWhenTheServerDoesNotRead) {
  ScriptedServer server({.reads = false});
  constexpr std::size_t kLimit = 256 * 1024;
  Client client(server.tcpName(), {.connectTimeout = 0ms, .sendTimeout = 300ms, .queueLimit_bytes = kLimit});
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!client.connected() && std::chrono::steady_clock::now() < end) client.poll(10ms);
  std::uint64_t mostWaiting = 0;
  int sent = 0;
  const auto fill = [&] {
    for (; sent < 10'000'000; ++sent) {
      client.setVertex(0, sent, 0, 0, 0);
      if (sent % 1000 == 0) {
        const Statistics s = client.statistics();
        mostWaiting = std::max(mostWaiting, s.messagesOut * 48 - std::min(s.messagesOut * 48, s.tcpBytesOut));
      }
    }
  };
  EXPECT_THAT(textOf<ConnectionLost>(fill), testing::AnyOf(HasSubstr("accepted no data"), HasSubstr("lost")));
  EXPECT_LT(sent, 10'000'000);
  EXPECT_LE(mostWaiting, kLimit + 2 * 64 * 1024) << "memory is bounded";
  EXPECT_FALSE(client.connected());
}

TEST(Client, AServerThatReadsLaterReceivesEverything) {
  ScriptedServer server({.reads = false});
  Client client(server.tcpName(), {.connectTimeout = 0ms, .queueLimit_bytes = 64 * 1024});
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!client.connected() && std::chrono::steady_clock::now() < end) client.poll(10ms);
  std::vector<std::array<float, 3>> corners(kManyVertices);
  std::thread later([&] {
    std::this_thread::sleep_for(50ms);  // so that the upload usually waits; the result does not depend on it
    server.startReading();
  });
  EXPECT_THROW(client.uploadCorners(0, std::span(corners).first(4)), std::invalid_argument)
      << "and sends nothing";
  client.uploadCorners(0, corners);
  later.join();
  EXPECT_EQ(server.waitVertices(corners.size()).size(), corners.size());
}

TEST(Client, AnUploadFailsWhenTheConnectionEnds) {
  ScriptedServer server;
  Client client(server.tcpName(), {.queueLimit_bytes = 64 * 1024});
  std::vector<std::array<float, 3>> corners(kManyVertices * 5);
  bool dropped = false;
  const auto upload = [&] {
    client.uploadCorners(0, corners, [&](const UploadProgress& p) {
      if (!dropped && p.bytesSent > 0) {
        server.dropClients();
        dropped = true;
      }
    });
  };
  EXPECT_THAT(textOf<ConnectionLost>(upload), HasSubstr("lost"));
}

}  // namespace
}  // namespace hapticd::test

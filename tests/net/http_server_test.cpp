#include "net/http_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::StartsWith;

#ifdef HAPTICD_SANITIZED
constexpr int kMany = 200;
#else
constexpr int kMany = 3000;
#endif

/// A server that says what it was asked, and a raw client of it in the same thread.
struct Http {
  explicit Http(const HttpOptions& options = {})
      : server(
            loop, kAnyPort,
            [this](const HttpRequest& request, const HttpReply& reply) {
              requests.push_back(request);
              handle(request, reply);
            },
            options) {}

  void handle(const HttpRequest& request, const HttpReply& reply) {
    if (request.path() == "/later") {
      later.push_back(reply);
    } else if (request.path() == "/large") {
      HttpResponse response;
      response.body = large;
      reply(response);
    } else {
      reply(HttpResponse::of(200, request.method + ' ' + request.target));
    }
  }

  RawSocket join(int receiveBufferBytes = 0) {
    return RawSocket::connected(server.local(), receiveBufferBytes);
  }
  /// Until the peer has so many bytes, or the connection has ended.
  std::string receive(RawSocket& peer, std::size_t size) {
    std::string text;
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (text.size() < size && std::chrono::steady_clock::now() < end) {
      std::string part(std::min<std::size_t>(size - text.size(), 65536), '\0');
      const ssize_t got = ::recv(peer.fd(), part.data(), part.size(), MSG_DONTWAIT);
      if (got == 0 || (got < 0 && errno != EAGAIN)) break;
      if (got > 0) {
        text.append(part, 0, static_cast<std::size_t>(got));
      } else {
        loop.runOnce(1ms);
      }
    }
    return text;
  }
  std::string receiveAll(RawSocket& peer) { return receive(peer, std::size_t{1} << 30); }
  std::string ask(const std::string& request) {
    RawSocket peer = join();
    EXPECT_TRUE(peer.send(request));
    return receiveAll(peer);
  }

  Loop loop;
  std::vector<HttpRequest> requests;
  std::vector<HttpReply> later;
  std::shared_ptr<const Buffer> large = std::make_shared<const Buffer>(std::size_t{20} << 20, std::byte{'x'});
  HttpServer server;
};

const std::string kGet = "GET / HTTP/1.1\r\nHost: here\r\n\r\n";
const std::string kGetLast = "GET / HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n";
const std::string kAnswer =
    "HTTP/1.1 200 OK\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: 5\r\n\r\nGET /";

TEST(HttpServer, AnswersWithHeadersAndBody) {
  Http http;
  RawSocket peer = http.join();
  ASSERT_TRUE(peer.send("GET /a/b?c=1&d=&e HTTP/1.1\r\nHost: here\r\nX-Thing:  two words \r\n\r\n"));
  EXPECT_THAT(http.receive(peer, 97), HasSubstr("Content-Length: 17\r\n\r\nGET /a/b?c=1&d=&e"));
  ASSERT_EQ(http.requests.size(), 1u);
  const HttpRequest& request = http.requests.front();
  EXPECT_EQ(request.path(), "/a/b");
  EXPECT_EQ(request.header("x-thing"), "two words");
  EXPECT_EQ(request.count("host"), 1u);
  EXPECT_EQ(request.header("nothing"), "");
  EXPECT_EQ(request.parameter("c"), "1");
  EXPECT_EQ(request.parameter("d"), "");
  EXPECT_EQ(request.parameter("e"), "");
  EXPECT_EQ(request.parameter("f"), std::nullopt);
  EXPECT_EQ(request.local, http.server.local());
}

TEST(HttpServer, ARequestMayComeInAnyPieces) {
  Http http;
  RawSocket peer = http.join();
  for (const char c : kGet) {
    ASSERT_TRUE(peer.send(std::string(1, c)));
    http.loop.runOnce(1ms);
  }
  EXPECT_EQ(http.receive(peer, kAnswer.size()), kAnswer);
}

TEST(HttpServer, RequestsInOneGoAreAnsweredInOrder) {
  Http http;
  RawSocket peer = http.join();
  std::string all;
  std::string expected;
  for (int i = 0; i < 300; ++i) {
    all += kGet;
    expected += kAnswer;
  }
  ASSERT_TRUE(peer.send(all));
  EXPECT_EQ(http.receive(peer, expected.size()), expected);
}

TEST(HttpServer, HeadHasTheHeadersAlone) {
  Http http;
  const std::string answer = http.ask("HEAD / HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(answer, HasSubstr("Content-Length: 6\r\n"));
  EXPECT_THAT(answer, testing::EndsWith("\r\n\r\n"));
}

TEST(HttpServer, AnOldClientIsAnsweredAndLeft) {
  Http http;
  EXPECT_THAT(http.ask("GET / HTTP/1.0\r\n\r\n"), HasSubstr("Connection: close\r\n\r\nGET /"));
}

// Without the header such a client waits for the end of the connection.
TEST(HttpServer, AnOldClientThatMayStayIsToldSo) {
  Http http;
  RawSocket peer = http.join();
  const std::string answer =
      "HTTP/1.1 200 OK\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: 5\r\n"
      "Connection: keep-alive\r\n\r\nGET /";
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(peer.send("GET / HTTP/1.0\r\nConnection: Keep-Alive\r\n\r\n"));
    EXPECT_EQ(http.receive(peer, answer.size()), answer);
  }
}

// RFC 9112, 3.2.2: such a target names the server, and the Host header does not count.
TEST(HttpServer, ATargetMayBeAWholeAddress) {
  Http http;
  struct Case {
    const char* sent;
    const char* target;
    const char* host;
  };
  for (const Case& c : {Case{"http://here:80/a/b?c=http://d/", "/a/b?c=http://d/", "here:80"},
                        Case{"HTTP://here", "/", "here"}, Case{"https://here?c=1", "/?c=1", "here"},
                        Case{"http:///a", "/a", ""}, Case{"http://here:80@there/", "/", "here:80@there"},
                        Case{"/http://there/", "/http://there/", "other"},
                        Case{"ftp://here/", "ftp://here/", "other"}, Case{"*", "*", "other"}}) {
    http.requests.clear();
    http.ask(std::string("GET ") + c.sent + " HTTP/1.1\r\nHost: other\r\nConnection: close\r\n\r\n");
    ASSERT_EQ(http.requests.size(), 1u) << c.sent;
    EXPECT_EQ(http.requests.front().target, c.target);
    EXPECT_EQ(http.requests.front().header("host"), c.host) << c.sent;
    EXPECT_EQ(http.requests.front().count("host"), 1u);
  }
  http.requests.clear();
  http.ask("GET http://here/ HTTP/1.1\r\nConnection: close\r\n\r\n");
  http.ask("GET http://here/ HTTP/1.1\r\nHost: here\r\nHost: here\r\nConnection: close\r\n\r\n");
  ASSERT_EQ(http.requests.size(), 2u);
  EXPECT_EQ(http.requests[0].count("host"), 0u) << "a missing one stays missing";
  EXPECT_EQ(http.requests[1].count("host"), 2u);
}

TEST(HttpServer, WhoAsksBeforeTheBodyIsTold) {
  Http http;
  const std::string go = "HTTP/1.1 100 Continue\r\n\r\n";
  RawSocket peer = http.join();
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(
        peer.send("POST / HTTP/1.1\r\nHost: here\r\nExpect: 100-Continue\r\nContent-Length: 4\r\n\r\n"));
    EXPECT_EQ(http.receive(peer, go.size()), go);
    EXPECT_EQ(http.requests.size(), static_cast<std::size_t>(i));
    ASSERT_TRUE(peer.send("bo"));
    http.loop.runOnce(1ms);
    ASSERT_TRUE(peer.send("dy"));
    EXPECT_EQ(
        http.receive(peer, kAnswer.size() + 1),
        "HTTP/1.1 200 OK\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: 6\r\n\r\nPOST /");
    ASSERT_EQ(http.requests.size(), static_cast<std::size_t>(i) + 1);
    EXPECT_EQ(http.requests.back().body, "body");
  }
  const std::string chunked =
      "Expect: 100-continue\r\nTransfer-Encoding: chunked\r\nConnection: close\r\n\r\n";
  EXPECT_THAT(http.ask("POST / HTTP/1.1\r\n" + chunked + "1\r\nx\r\n0\r\n\r\n"), HasSubstr("\r\n\r\nPOST /"));
  EXPECT_THAT(http.ask("POST / HTTP/1.1\r\nExpect: 100-continue\r\nContent-Length: 5000\r\n\r\n"),
              StartsWith("HTTP/1.1 413 "))
      << "the body is not asked for";
  EXPECT_THAT(http.ask("GET / HTTP/1.1\r\nExpect: 100-continue\r\nConnection: close\r\n\r\n"),
              StartsWith("HTTP/1.1 200 "))
      << "there is none";
  RawSocket old = http.join();
  ASSERT_TRUE(old.send("POST / HTTP/1.0\r\nExpect: 100-continue\r\nContent-Length: 1\r\n\r\n"));
  for (int i = 0; i < 5; ++i) http.loop.runOnce(1ms);
  ASSERT_TRUE(old.send("x"));
  EXPECT_THAT(http.receiveAll(old), StartsWith("HTTP/1.1 200 "));
}

TEST(HttpServer, ABodyIsGiven) {
  Http http;
  http.ask("POST / HTTP/1.1\r\nHost: here\r\nConnection: close\r\nContent-Length: 4\r\n\r\nbody");
  ASSERT_EQ(http.requests.size(), 1u);
  EXPECT_EQ(http.requests.front().body, "body");
}

TEST(HttpServer, AnswersMayComeLater) {
  Http http;
  RawSocket one = http.join();
  RawSocket two = http.join();
  ASSERT_TRUE(one.send("GET /later HTTP/1.1\r\nHost: here\r\n\r\n" + kGet));
  ASSERT_TRUE(pumpUntil(http.loop, [&] { return http.later.size() == 1; }));
  ASSERT_TRUE(two.send(kGet));
  EXPECT_EQ(http.receive(two, kAnswer.size()), kAnswer);
  EXPECT_EQ(http.requests.size(), 2u) << "the second request waits for the answer to the first";
  http.later[0](HttpResponse::of(200, "GET /"));
  http.later[0](HttpResponse::of(200, "twice"));
  EXPECT_EQ(http.receive(one, 2 * kAnswer.size()), kAnswer + kAnswer);
}

TEST(HttpServer, AnAnswerToNobodyIsDropped) {
  Http http;
  RawSocket peer = http.join();
  ASSERT_TRUE(peer.send("GET /later HTTP/1.1\r\nHost: here\r\n\r\n"));
  ASSERT_TRUE(pumpUntil(http.loop, [&] { return http.later.size() == 1; }));
  peer.reset();
  http.later[0](HttpResponse::of(200, "hello?"));
  EXPECT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == 0; }));
}

TEST(HttpServer, WhatIsNoHttpIsRefused) {
  Http http;
  EXPECT_THAT(http.ask("vrpn: ver. 07.35  0\r\n\r\n"), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(http.ask("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n"), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(http.ask("GET / HTTP/1.1\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n"),
              StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(http.ask("GET / HTTP/1.1\r\nbad header\r\n\r\n"), StartsWith("HTTP/1.1 400 "));
  // The body of an unknown coding must not be taken for the next request.
  const std::string smuggled = "GET /smuggled HTTP/1.1\r\n\r\n";
  for (const char* coding : {"xchunked", "identity", "gzip, chunked"}) {
    EXPECT_THAT(
        http.ask(std::string("GET / HTTP/1.1\r\nTransfer-Encoding: ") + coding + "\r\n\r\n" + smuggled),
        AnyOf(StartsWith("HTTP/1.1 501 "), StartsWith("HTTP/1.1 400 ")))
        << coding;
  }
  EXPECT_TRUE(http.requests.empty());
}

TEST(HttpServer, WhatIsTooLongIsRefused) {
  Http http;
  const std::string lines(20000, 'x');
  EXPECT_THAT(http.ask("GET / HTTP/1.1\r\nX: " + lines + "\r\n\r\n"), StartsWith("HTTP/1.1 431 "));
  EXPECT_THAT(http.ask("GET /" + lines), StartsWith("HTTP/1.1 431 "));
  EXPECT_THAT(http.ask("POST / HTTP/1.1\r\nContent-Length: 5000\r\n\r\n"), StartsWith("HTTP/1.1 413 "));
  std::string many = "GET / HTTP/1.1\r\n";
  for (int i = 0; i < 2000; ++i) many += "A: b\r\n";
  EXPECT_THAT(http.ask(many + "\r\n"), StartsWith("HTTP/1.1 431 "));
  EXPECT_TRUE(http.requests.empty());
}

TEST(HttpServer, GarbageDoesNoHarm) {
  Http http;
  std::mt19937 random(3);
  for (int i = 0; i < kMany / 20; ++i) {
    std::string bytes(1 + random() % 3000, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    RawSocket peer = http.join();
    peer.send(bytes);
    peer.shutdownSend();
    http.receiveAll(peer);
  }
  EXPECT_EQ(http.ask(kGetLast).substr(0, 15), "HTTP/1.1 200 OK");
  EXPECT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == 0; }));
}

TEST(HttpServer, HalfARequestIsNotWaitedForLong) {
  HttpOptions options;
  options.requestTimeout = 50ms;
  Http http(options);
  RawSocket peer = http.join();
  ASSERT_TRUE(peer.send("GET / HTTP/1.1\r\nHost"));
  EXPECT_EQ(http.receiveAll(peer), "");
  EXPECT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == 0; }));
}

TEST(HttpServer, AnIdleClientIsLetGo) {
  HttpOptions options;
  options.idleTimeout = 50ms;
  Http http(options);
  RawSocket silent = http.join();
  EXPECT_EQ(http.receiveAll(silent), "");
  RawSocket once = http.join();
  ASSERT_TRUE(once.send(kGet));
  EXPECT_EQ(http.receiveAll(once), kAnswer);
}

TEST(HttpServer, ALargeAnswerIsNeverQueuedAsAWhole) {
  Http http;
  RawSocket peer = http.join();
  ASSERT_TRUE(peer.send("GET /large HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n"));
  const std::string answer = http.receiveAll(peer);
  const std::size_t head = answer.find("\r\n\r\n") + 4;
  EXPECT_EQ(answer.size() - head, http.large->size());
  EXPECT_EQ(answer.find_first_not_of('x', head), std::string::npos);
}

TEST(HttpServer, WhoDoesNotReadIsLetGo) {
  HttpOptions options;
  options.answerTimeout = 200ms;
  Http http(options);
  RawSocket peer = http.join(4096);
  ASSERT_TRUE(peer.send("GET /large HTTP/1.1\r\nHost: here\r\n\r\n"));
  ASSERT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == 1; }));
  EXPECT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == 0; }));
}

TEST(HttpServer, TooManyConnectionsAreRefusedAndRoomComesBack) {
  HttpOptions options;
  options.connections = 3;
  Http http(options);
  std::vector<RawSocket> peers;
  for (std::size_t i = 0; i < 3; ++i) {
    peers.push_back(http.join());
    ASSERT_TRUE(peers.back().send("GET /later HTTP/1.1\r\nHost: here\r\n\r\n"));
    ASSERT_TRUE(pumpUntil(http.loop, [&] { return http.later.size() == i + 1; }));
  }
  RawSocket more = http.join();
  EXPECT_EQ(http.receiveAll(more), "") << "those that wait for an answer stay";
  peers.pop_back();
  http.later.back()(HttpResponse::of(200, "late"));
  ASSERT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == 2; }));
  EXPECT_THAT(http.ask(kGetLast), StartsWith("HTTP/1.1 200 OK"));
}

// Whoever holds connections open and asks nothing, or asks for ever, keeps nobody out.
TEST(HttpServer, SilentConnectionsGiveWayToNewOnes) {
  HttpOptions options;
  options.connections = 4;
  Http http(options);
  std::vector<RawSocket> peers;
  for (int i = 0; i < 4; ++i) {
    peers.push_back(http.join());
    if (i == 0) {
      ASSERT_TRUE(peers[0].send("GET / HTT"));
    }
    ASSERT_TRUE(
        pumpUntil(http.loop, [&] { return http.server.connections() == static_cast<std::size_t>(i) + 1; }));
  }
  for (int i = 0; i < 3; ++i) {
    RawSocket page = http.join();
    ASSERT_TRUE(page.send(kGet));
    EXPECT_EQ(http.receive(page, kAnswer.size()), kAnswer);
    peers.push_back(std::move(page));
    EXPECT_EQ(http.server.connections(), 4U);
  }
  ASSERT_TRUE(peers[0].send("P/1.1\r\n\r\n"));
  EXPECT_THAT(http.receive(peers[0], 15), StartsWith("HTTP/1.1 200 OK")) << "silent ones first";
  EXPECT_EQ(http.receiveAll(peers[1]), "");
}

// Whoever holds the most makes room, and nobody for one that holds more.
TEST(HttpServer, OneAddressKeepsNoOtherOut) {
  HttpOptions options;
  options.connections = 3;
  Http http(options);
  const auto joinFrom = [&](int address, std::size_t connections) {
    RawSocket peer = RawSocket::connectedFrom(address, http.server.local());
    EXPECT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == connections; }));
    return peer;
  };
  RawSocket quiet = joinFrom(2, 1);  // the oldest, and idle
  std::vector<RawSocket> crowd;
  for (const std::size_t connections : {2, 3, 3}) crowd.push_back(joinFrom(3, connections));
  EXPECT_EQ(http.receiveAll(crowd[0]), "") << "makes room for another of its own";
  for (std::size_t i = 1; i < 3; ++i) {
    ASSERT_TRUE(crowd[i].send("GET /later HTTP/1.1\r\nHost: here\r\n\r\n"));
    ASSERT_TRUE(pumpUntil(http.loop, [&] { return http.later.size() == i; }));
  }
  RawSocket more = RawSocket::connectedFrom(3, http.server.local());
  EXPECT_EQ(http.receiveAll(more), "") << "its own wait for answers, and the quiet one holds fewer";
  for (const HttpReply& reply : http.later) reply(HttpResponse::of(200, "late"));
  RawSocket other = RawSocket::connectedFrom(4, http.server.local());
  for (RawSocket* kept : {&quiet, &other}) {
    ASSERT_TRUE(kept->send(kGet));
    EXPECT_EQ(http.receive(*kept, kAnswer.size()), kAnswer) << "the crowd makes room";
  }
}

TEST(HttpServer, ThousandsOfRequestsLeaveNothingBehind) {
  Http http;
  const auto openFiles = [] {
    const std::filesystem::directory_iterator files("/proc/self/fd");
    return std::distance(begin(files), end(files));
  };
  http.ask(kGetLast);
  ASSERT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == 0; }));
  const auto before = openFiles();
  for (int i = 0; i < kMany / 10; ++i) ASSERT_THAT(http.ask(kGetLast), StartsWith("HTTP/1.1 200 OK"));
  RawSocket peer = http.join();
  for (int i = 0; i < kMany; ++i) {
    ASSERT_TRUE(peer.send(kGet));
    ASSERT_EQ(http.receive(peer, kAnswer.size()), kAnswer);
  }
  peer.close();
  ASSERT_TRUE(pumpUntil(http.loop, [&] { return http.server.connections() == 0; }));
  EXPECT_EQ(openFiles(), before);
}

TEST(HttpServer, APortInUseIsSaidWithItsOption) {
  Http http;
  try {
    const HttpServer second(http.loop, http.server.local(), {});
    FAIL() << "two servers on one port";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("choose another with --http"));
  }
}

}  // namespace
}  // namespace hapticd::net

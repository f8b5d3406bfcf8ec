// A WebSocket as a Connection, against raw bytes and against a client that is not ours (Boost.Beast's).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fcntl.h>
#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <numeric>
#include <thread>

#include "net/client_frames.h"
#include "net/http_server.h"
#include "net/loopback.h"
#include "net/web_socket_frames.h"

namespace hapticd::net {
namespace {

using namespace std::chrono_literals;
using namespace std::string_literals;
using testing::HasSubstr;
using testing::StartsWith;

/// A server that takes every WebSocket and keeps what happens to it.
struct Sockets {
  explicit Sockets(bool echo = false, const ConnectionOptions& connectionOptions = {})
      : server(
            loop, kAnyPort,
            [this, echo](const HttpRequest&, const HttpReply& reply) {
              HttpResponse response = HttpResponse::of(426, "a WebSocket");
              response.onWebSocket = [this, echo](Connection c) { take(std::move(c), echo); };
              reply(response);
            },
            [&] {
              HttpOptions options;
              options.connection = connectionOptions;
              return options;
            }()) {}

  void take(Connection taken, bool echo) {
    connection = std::move(taken);
    connection.start({.onConnected = {},
                      .onBytes =
                          [this, echo](std::span<const std::byte> bytes) {
                            received += textOf(bytes);
                            if (!echo) return;
                            connection.send(bytes);
                            connection.flush();
                          },
                      .onDrained = [this] { ++drained; },
                      .onClosed = [this](const std::string& reason) { closed = reason; }});
  }
  /// A raw peer behind its greeting.
  RawSocket join(int receiveBufferBytes = 0) {
    RawSocket peer = RawSocket::connected(server.local(), receiveBufferBytes);
    EXPECT_TRUE(peer.send(upgradeRequest("/")));
    EXPECT_TRUE(pumpUntil(loop, [&] { return static_cast<bool>(connection); }));
    EXPECT_EQ(peer.receive(kUpgradeAnswer.size()), kUpgradeAnswer);
    return peer;
  }
  bool untilReceived(std::string_view text) {
    return pumpUntil(loop, [&] { return received == text; });
  }
  bool untilClosed() {
    return pumpUntil(loop, [&] { return !closed.empty(); });
  }

  Loop loop;
  Connection connection;
  std::string received;
  std::string closed;
  int drained = 0;
  HttpServer server;
};

std::string binary(std::string_view text) {
  return textOf(webSocketFrame(WebSocketOpcode::binary, bytesOf(text)));
}

TEST(WebSocket, CarriesBytesBothWays) {
  Sockets sockets;
  RawSocket peer = sockets.join();
  ASSERT_TRUE(peer.send(clientFrame(kBinary, "hello") + clientFrame(kBinaryBegin, " wo")));
  ASSERT_TRUE(peer.send(clientFrame(kLast, "rld")));
  EXPECT_TRUE(sockets.untilReceived("hello world"));
  sockets.connection.send(bytesOf("one"));
  sockets.connection.send(bytesOf("two"));
  sockets.connection.flush();
  EXPECT_EQ(peer.receive(10), binary("one") + binary("two"));
  const ConnectionStatistics counts = sockets.connection.statistics();
  EXPECT_GE(counts.bytesIn, 11u);
  EXPECT_GE(counts.bytesOut, 10u);
  EXPECT_EQ(counts.queuedBytes, 0u);
  EXPECT_EQ(sockets.connection.remote().address, kLoopbackAddress);
  EXPECT_EQ(sockets.server.connections(), 0u) << "it belongs to who took it";
}

TEST(WebSocket, WhatCameBehindTheGreetingIsRead) {
  Sockets sockets;
  RawSocket peer = RawSocket::connected(sockets.server.local());
  ASSERT_TRUE(
      peer.send(upgradeRequest("/") + clientFrame(kBinary, "early") + clientFrame(kBinaryBegin, " bi")));
  ASSERT_TRUE(sockets.untilReceived("early bi"));
  ASSERT_TRUE(peer.send(clientFrame(kLast, "rd")));
  EXPECT_TRUE(sockets.untilReceived("early bird"));
}

TEST(WebSocket, PingsAreAnsweredWithinAMessage) {
  Sockets sockets;
  RawSocket peer = sockets.join();
  ASSERT_TRUE(peer.send(clientFrame(kBinaryBegin, "a") + clientFrame(kPing, "still there?") +
                        clientFrame(kLast, "b")));
  ASSERT_TRUE(sockets.untilReceived("ab"));
  EXPECT_EQ(peer.receive(14), "\x8a\x0cstill there?");
}

TEST(WebSocket, TheEndOfThePeerIsAnsweredAndTold) {
  Sockets sockets;
  RawSocket peer = sockets.join();
  ASSERT_TRUE(peer.send(clientFrame(kBinary, "last words") + clientFrame(kClose, "\x03\xe9")));
  ASSERT_TRUE(pumpUntil(sockets.loop, [&] { return !sockets.connection.isOpen(); }));
  EXPECT_EQ(peer.receive(4), "\x88\x02\x03\xe9");
  EXPECT_EQ(peer.receive(1), "") << "the server ends the connection";
  peer.close();
  ASSERT_TRUE(sockets.untilClosed());
  EXPECT_EQ(sockets.closed, "closed by the peer");
  EXPECT_EQ(sockets.received, "last words");
}

TEST(WebSocket, OurEndSendsWhatIsQueuedAndTheReason) {
  Sockets sockets;
  RawSocket peer = sockets.join();
  sockets.connection.send(bytesOf("bye"));
  sockets.connection.close("no more");
  EXPECT_FALSE(sockets.connection.isOpen());
  sockets.connection.send(bytesOf("too late"));
  EXPECT_EQ(peer.receive(16), binary("bye") + "\x88\x09\x03\xe8no more");
  EXPECT_EQ(peer.receive(1), "");
  ASSERT_TRUE(peer.send(clientFrame(kClose, "\x03\xe8")));
  peer.close();
  ASSERT_TRUE(sockets.untilClosed());
  EXPECT_EQ(sockets.closed, "no more");
}

TEST(WebSocket, AMistakeIsToldAndEndsIt) {
  Sockets sockets;
  RawSocket peer = sockets.join();
  ASSERT_TRUE(peer.send("\x82\x05plain"));
  ASSERT_TRUE(pumpUntil(sockets.loop, [&] { return !sockets.connection.isOpen(); }));
  const std::string answer = peer.receive(1000);
  EXPECT_THAT(answer, StartsWith("\x88"));
  EXPECT_THAT(answer, HasSubstr("\x03\xea"
                                "a frame is not masked"));
  peer.close();
  ASSERT_TRUE(sockets.untilClosed());
  EXPECT_EQ(sockets.closed, "WebSocket error: a frame is not masked");
}

TEST(WebSocket, APeerThatVanishesIsTold) {
  Sockets sockets;
  RawSocket peer = sockets.join();
  peer.reset();
  ASSERT_TRUE(sockets.untilClosed());
  EXPECT_EQ(sockets.closed, "connection reset by the peer");
}

TEST(WebSocket, ASlowReaderLosesLowLatencyBuffersWhole) {
  ConnectionOptions options;
  options.lowMarkBytes = 4096;
  options.sendBufferBytes = 4096;
  Sockets sockets(false, options);
  RawSocket peer = sockets.join(4096);
  int sent = 0;
  while (sockets.connection.statistics().droppedBuffers < 10) {
    ASSERT_LT(++sent, 100000);
    sockets.connection.send(bufferOf(std::string(500, static_cast<char>('a' + sent % 26))),
                            Delivery::lowLatency);
    sockets.connection.flush();
  }
  sockets.connection.send(bytesOf("reliable"));
  sockets.connection.flush();
  // Every frame that comes is whole: 4 bytes of head, one letter 500 times; the reliable one is the last.
  std::string stream;
  ASSERT_TRUE(pumpUntil(sockets.loop, [&] {
    std::string part(65536, '\0');
    const ssize_t got = ::recv(peer.fd(), part.data(), part.size(), MSG_DONTWAIT);
    if (got > 0) stream.append(part, 0, static_cast<std::size_t>(got));
    return stream.ends_with(binary("reliable"));
  }));
  stream.resize(stream.size() - binary("reliable").size());
  ASSERT_EQ(stream.size() % 504, 0u);
  for (std::size_t at = 0; at < stream.size(); at += 504) {
    ASSERT_EQ(stream.substr(at, 504), binary(std::string(500, stream[at + 4])));
  }
  EXPECT_TRUE(pumpUntil(sockets.loop, [&] { return sockets.drained > 0; }));
}

TEST(WebSocket, AReaderThatStopsIsEndedAtTheHardLimit) {
  ConnectionOptions options;
  options.hardLimitBytes = 1 << 20;
  Sockets sockets(false, options);
  const RawSocket peer = sockets.join(4096);
  for (int i = 0; i < 100000 && sockets.connection.isOpen(); ++i) {
    sockets.connection.send(Buffer(10000));
    sockets.connection.flush();
  }
  ASSERT_TRUE(sockets.untilClosed());
  EXPECT_THAT(sockets.closed, HasSubstr("the peer does not read"));
}

TEST(WebSocket, PingsOfWhoDoesNotReadEndAtTheHardLimit) {
  ConnectionOptions options;
  options.hardLimitBytes = 100000;
  Sockets sockets(false, options);
  RawSocket peer = sockets.join(4096);
  const int flags = ::fcntl(peer.fd(), F_GETFL);
  ::fcntl(peer.fd(), F_SETFL, flags | O_NONBLOCK);
  const std::string pings = [] {
    std::string many;
    for (int i = 0; i < 100; ++i) many += clientFrame(kPing, std::string(125, 'p'));
    return many;
  }();
  // Cut where the system takes no more: the rest must follow, or the frames would be wrong.
  std::string rest;
  ASSERT_TRUE(pumpUntil(sockets.loop, [&] {
    if (rest.empty()) rest = pings;
    const ssize_t got = ::send(peer.fd(), rest.data(), rest.size(), MSG_NOSIGNAL);
    if (got > 0) rest.erase(0, static_cast<std::size_t>(got));
    return !sockets.closed.empty();
  }));
  EXPECT_THAT(sockets.closed, HasSubstr("the peer does not read"));
}

TEST(WebSocket, PausedReadingHoldsThePeerBack) {
  Sockets sockets;
  RawSocket peer = sockets.join();
  sockets.connection.pauseReading();
  ASSERT_TRUE(peer.send(clientFrame(kBinary, "later")));
  sockets.loop.runFor(50ms);
  EXPECT_EQ(sockets.received, "");
  sockets.connection.resumeReading();
  EXPECT_TRUE(sockets.untilReceived("later"));
}

TEST(WebSocket, ACallbackMayDestroyItsConnection) {
  Sockets sockets;
  RawSocket peer = sockets.join();
  bool told = false;
  sockets.connection.start({.onConnected = {},
                            .onBytes =
                                [&](std::span<const std::byte>) {
                                  sockets.connection = Connection();
                                  told = true;
                                },
                            .onDrained = {},
                            .onClosed = [&](const std::string&) { ADD_FAILURE() << "it has no owner"; }});
  ASSERT_TRUE(peer.send(clientFrame(kBinary, "go") + clientFrame(kClose, "")));
  ASSERT_TRUE(pumpUntil(sockets.loop, [&] { return told; }));
  EXPECT_EQ(peer.receive(1), "");
}

TEST(WebSocket, OddGreetingsAreRefused) {
  Sockets sockets;
  const auto ask = [&](const std::string& request) {
    RawSocket peer = RawSocket::connected(sockets.server.local());
    EXPECT_TRUE(peer.send(request));
    std::string text(65536, '\0');
    ssize_t got = -1;
    pumpUntil(sockets.loop, [&] {
      got = ::recv(peer.fd(), text.data(), text.size(), MSG_DONTWAIT);
      return got >= 0;
    });
    return text.substr(0, static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  };
  std::string old = upgradeRequest("/");
  old.replace(old.find("Version: 13"), 11, "Version: 8 ");
  EXPECT_THAT(ask(old), AllOf(StartsWith("HTTP/1.1 426 "), HasSubstr("Sec-WebSocket-Version: 13\r\n")));
  std::string keyless = upgradeRequest("/");
  keyless.replace(keyless.find("dGhl"), 4, "");
  EXPECT_THAT(ask(keyless), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(ask("GET / HTTP/1.1\r\nHost: here\r\n\r\n"), StartsWith("HTTP/1.1 426 "));
  EXPECT_FALSE(sockets.connection);
}

// Another implementation of the protocol, in its own thread, must understand what we say.
TEST(WebSocket, AnotherImplementationEchoesEverySize) {
  namespace asio = boost::asio;
  namespace beast = boost::beast;
  Sockets sockets(true);
  bool same = true;
  std::thread client([&, port = sockets.server.local().port] {
    asio::io_context context;
    beast::websocket::stream<asio::ip::tcp::socket> stream(context);
    stream.next_layer().connect({asio::ip::address_v4::loopback(), port});
    stream.handshake("localhost", "/");
    stream.binary(true);
    stream.auto_fragment(true);
    stream.write_buffer_bytes(1000);
    for (const std::size_t size : {1, 125, 126, 1000, 65535, 65536, 300000}) {
      std::string out(size, '\0');
      std::iota(out.begin(), out.end(), '\0');
      stream.write(asio::buffer(out));
      std::string in;
      while (in.size() < size) {
        beast::flat_buffer buffer;
        stream.read(buffer);
        in += beast::buffers_to_string(buffer.data());
      }
      same = same && in == out;
    }
    stream.ping("ping");
    stream.close(beast::websocket::close_code::normal);
  });
  EXPECT_TRUE(sockets.untilClosed());
  client.join();
  EXPECT_TRUE(same);
  EXPECT_EQ(sockets.closed, "closed by the peer");
}

}  // namespace
}  // namespace hapticd::net

#include "net/web_socket_frames.h"

#include <gtest/gtest.h>

#include <random>

#include "net/client_frames.h"
#include "net/loopback.h"
#include "net/sha1.h"

namespace hapticd::net {
namespace {

using namespace std::string_literals;

std::string hex(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

WebSocketInput read(std::string_view bytes) {
  WebSocketReader reader;
  WebSocketInput in;
  reader.feed(bytesOf(bytes), in);
  return in;
}

// What the reader must find wrong, and what it tells the peer.
void expectError(std::string_view bytes, std::uint16_t code, std::string_view words) {
  const WebSocketInput in = read(bytes);
  ASSERT_TRUE(in.end) << words;
  EXPECT_TRUE(in.end->isError);
  EXPECT_EQ(in.end->code, code);
  EXPECT_NE(in.end->text.find(words), std::string::npos) << in.end->text;
}

TEST(Sha1, KnownDigests) {  // FIPS 180-4's examples
  EXPECT_EQ(hex(sha1("")), "da39a3ee5e6b4b0d3255bfef95601890afd80709");
  EXPECT_EQ(hex(sha1("abc")), "a9993e364706816aba3e25717850c26c9cd0d89d");
  EXPECT_EQ(hex(sha1("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq")),
            "84983e441c3bd26ebaae4aa1f95129e5e54670f1");
  EXPECT_EQ(hex(sha1(std::string(1000000, 'a'))), "34aa973cd4c4daa4f61eeb2bdbad27316534016f");
}

TEST(Sha1, Base64OfEveryLength) {  // RFC 4648's examples
  const auto of = [](std::string_view text) {
    return base64({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  };
  EXPECT_EQ(of(""), "");
  EXPECT_EQ(of("f"), "Zg==");
  EXPECT_EQ(of("fo"), "Zm8=");
  EXPECT_EQ(of("foo"), "Zm9v");
  EXPECT_EQ(of("foob"), "Zm9vYg==");
}

TEST(WebSocketFrames, AcceptsTheKeyOfTheStandard) {
  EXPECT_EQ(webSocketAccept("dGhlIHNhbXBsZSBub25jZQ=="), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
}

TEST(WebSocketFrames, ReadsTheMaskedHelloOfTheStandard) {
  // RFC 6455, 5.7: "Hello" with the mask 37 fa 21 3d; as a binary message.
  const WebSocketInput in = read("\x82\x85\x37\xfa\x21\x3d\x7f\x9f\x4d\x51\x58");
  EXPECT_EQ(textOf(in.data), "Hello");
  EXPECT_FALSE(in.end);
}

TEST(WebSocketFrames, ReadsPayloadsOfEveryLengthForm) {
  for (const std::size_t size : {0, 1, 125, 126, 65535, 65536, 200000}) {
    std::string payload(size, '\0');
    for (std::size_t i = 0; i < size; ++i) payload[i] = static_cast<char>(i * 7);
    const WebSocketInput in = read(clientFrame(kBinary, payload));
    EXPECT_EQ(textOf(in.data), payload) << size;
    EXPECT_FALSE(in.end);
  }
}

TEST(WebSocketFrames, AnySplitGivesTheSame) {
  const std::string stream = clientFrame(kBinary, "one") + clientFrame(kBinaryBegin, "tw") +
                             clientFrame(kPing, "hello") + clientFrame(kMore, "") + clientFrame(kLast, "o") +
                             clientFrame(kPong, "nobody asked") +
                             clientFrame(kBinary, std::string(300, 'x')) + clientFrame(kPing, "") +
                             clientFrame(kClose,
                                         "\x03\xe9"
                                         "bye") +
                             clientFrame(kBinary, "after the end");
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    WebSocketReader reader;
    WebSocketInput in;
    std::string_view rest = stream;
    while (!rest.empty()) {
      const std::size_t size = std::min<std::size_t>(rest.size(), 1 + random() % (round == 0 ? 1 : 40));
      reader.feed(bytesOf(rest.substr(0, size)), in);
      rest = rest.substr(size);
    }
    ASSERT_EQ(textOf(in.data), "onetwo" + std::string(300, 'x'));
    ASSERT_EQ(in.pings.size(), 2u);
    EXPECT_EQ(textOf(in.pings[0]), "hello");
    EXPECT_TRUE(in.pings[1].empty());
    ASSERT_TRUE(in.end);
    EXPECT_FALSE(in.end->isError);
    EXPECT_EQ(in.end->code, 1001);
    EXPECT_EQ(in.end->text, "bye");
  }
}

constexpr std::uint8_t kText = 0x81;
constexpr std::uint8_t kTextBegin = 0x01;

TEST(WebSocketFrames, TextsAreWholeMessages) {
  const std::string stream = clientFrame(kText, "one") + clientFrame(kTextBegin, "tw") +
                             clientFrame(kPing, "p") + clientFrame(kMore, "") + clientFrame(kLast, "o") +
                             clientFrame(kBinary, "") +
                             clientFrame(kText, std::string(WebSocketReader::kLongestText, 'x'));
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, stream.size()}) {
    WebSocketReader reader(WebSocketContent::texts);
    WebSocketInput in;
    for (std::size_t at = 0; at < stream.size(); at += piece)
      reader.feed(bytesOf(std::string_view(stream).substr(at, piece)), in);
    ASSERT_EQ(in.texts.size(), 4U) << piece;
    EXPECT_EQ(textOf(in.texts[0]), "one");
    EXPECT_EQ(textOf(in.texts[1]), "two");
    EXPECT_TRUE(in.texts[2].empty());
    EXPECT_EQ(in.texts[3].size(), WebSocketReader::kLongestText);
    EXPECT_TRUE(in.data.empty());
    EXPECT_EQ(in.pings.size(), 1U);
    EXPECT_FALSE(in.end);
  }
}

TEST(WebSocketFrames, TextsAreBounded) {
  const auto endOf = [](const std::string& bytes) {
    WebSocketReader reader(WebSocketContent::texts);
    WebSocketInput in;
    reader.feed(bytesOf(bytes), in);
    return in.end.value_or(WebSocketEnd{});
  };
  const std::string half(WebSocketReader::kLongestText / 2 + 1, 'x');
  EXPECT_EQ(endOf(clientFrame(kTextBegin, half) + clientFrame(kLast, half)).code, kWebSocketTooBig);
  EXPECT_EQ(endOf("\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff\x00\x00\x00\x00"s).code, kWebSocketTooBig);
  EXPECT_EQ(endOf(clientFrame(kTextBegin, "x") + clientFrame(kText, "y")).code, kWebSocketProtocolError);
}

TEST(WebSocketFrames, WhatIsNoClientsFrameIsAnError) {
  expectError("\x82\x01x", kWebSocketProtocolError, "not masked");
  expectError(clientFrame(0xc2, "x"), kWebSocketProtocolError, "reserved bits");
  expectError(clientFrame(0x83, "x"), kWebSocketProtocolError, "unknown kind");
  expectError(clientFrame(0x8b, "x"), kWebSocketProtocolError, "unknown kind");
  expectError(clientFrame(0x81, "text"), kWebSocketUnsupported, "only binary");
  expectError(clientFrame(kLast, "x"), kWebSocketProtocolError, "not begun");
  expectError(clientFrame(kBinaryBegin, "x") + clientFrame(kBinary, "y"), kWebSocketProtocolError,
              "inside another");
  expectError(clientFrame(0x09, "x"), kWebSocketProtocolError, "in pieces");
  expectError(clientFrame(kPing, std::string(126, 'x')), kWebSocketProtocolError, "too long");
  expectError("\x82\xfe\x00\x7d\x01\x02\x03\x04"s, kWebSocketProtocolError, "shortest form");
  expectError("\x82\xff\x00\x00\x00\x00\x00\x00\xff\xff\x01\x02\x03\x04"s, kWebSocketProtocolError,
              "shortest form");
  expectError("\x82\xff\x80\x00\x00\x00\x00\x01\x00\x00\x01\x02\x03\x04"s, kWebSocketProtocolError,
              "shortest form");
  expectError(clientFrame(kClose, "\x03"), kWebSocketProtocolError, "half a code");
  expectError(clientFrame(kClose, "\x03\xed"), kWebSocketProtocolError, "1005");
  expectError(clientFrame(kClose, "\x00\x01"s), kWebSocketProtocolError, "code 1");
}

TEST(WebSocketFrames, AFrameOfExabytesIsReadAsItComes) {
  WebSocketReader reader;
  WebSocketInput in;
  reader.feed(bytesOf("\x82\xff\x7f\xff\xff\xff\xff\xff\xff\xff\x00\x00\x00\x00"s), in);
  for (int i = 0; i < 1000; ++i) {
    reader.feed(bytesOf("part"), in);
    ASSERT_EQ(textOf(in.data), "part");
    in = {};
  }
  EXPECT_FALSE(in.end);
}

TEST(WebSocketFrames, GarbageEndsOrWaitsAndKeepsNothing) {
  std::mt19937 random(2);
  int ended = 0;
  for (int round = 0; round < 2000; ++round) {
    WebSocketReader reader;
    WebSocketInput in;
    std::string bytes(1 + random() % 200, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    reader.feed(bytesOf(bytes), in);
    EXPECT_LE(in.data.size(), bytes.size());
    ended += in.end ? 1 : 0;
  }
  EXPECT_GT(ended, 1500);
}

TEST(WebSocketFrames, WritesEveryLengthForm) {
  const auto start = [](std::size_t size) {
    const Buffer frame = webSocketFrame(WebSocketOpcode::binary, Buffer(size));
    return textOf(std::span(frame).first(frame.size() - size));
  };
  EXPECT_EQ(start(0), "\x82\x00"s);
  EXPECT_EQ(start(125), "\x82\x7d"s);
  EXPECT_EQ(start(126), "\x82\x7e\x00\x7e"s);
  EXPECT_EQ(start(65535), "\x82\x7e\xff\xff"s);
  EXPECT_EQ(start(65536), "\x82\x7f\x00\x00\x00\x00\x00\x01\x00\x00"s);
}

TEST(WebSocketFrames, AClosingFrameHoldsWhatFits) {
  EXPECT_EQ(textOf(webSocketClose(1000, "bye")),
            "\x88\x05\x03\xe8"
            "bye"s);
  EXPECT_EQ(webSocketClose(1000, std::string(123, 'x')), [] {
    Buffer frame = webSocketFrame(WebSocketOpcode::close, Buffer(125, std::byte{'x'}));
    frame[2] = std::byte{3};
    frame[3] = std::byte{0xe8};
    return frame;
  }());
  const std::string cut = textOf(webSocketClose(1000, std::string(124, 'x')));
  EXPECT_EQ(cut.size(), 127u);
  EXPECT_EQ(cut.substr(120), "xxxx...") << "who reads it knows that there was more";
  // Two bytes for each letter: half a letter would make the whole frame invalid.
  std::string umlauts;
  for (int i = 0; i < 100; ++i) umlauts += "\xc3\xa4";
  EXPECT_EQ(textOf(webSocketClose(1000, umlauts)).substr(4), umlauts.substr(0, 120) + "...");
  EXPECT_EQ(textOf(webSocketClose(1000, 'x' + umlauts)).substr(4), 'x' + umlauts.substr(0, 118) + "...");
}

}  // namespace
}  // namespace hapticd::net

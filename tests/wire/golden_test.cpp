// Every recorded byte is understood, and written again as VRPN wrote it.
#include <gtest/gtest.h>

#include "wire/cookie.h"
#include "wire/event_text.h"
#include "wire/peer.h"
#include "wire/recording.h"
#include "wire/udp_request.h"

namespace hapticd::wire {
namespace {

// Reads a recording twice over: through an endpoint, which counts and decodes, and frame by frame, which
// encodes.
class Listener {
 public:
  Listener() : endpoint_(names_, {UdpAddress{"127.0.0.1", 4000}, {}}) {}

  void stream(ByteView bytes) {
    endpoint_.feed(Time{}, bytes, [this](const Event& event) { note(event); });
    FrameEncoder again;
    rewrite(bytes.subspan(kCookieBytes), again);
  }
  void datagrams(const std::vector<Bytes>& all) {
    counts_.clear();
    FrameEncoder again;
    for (const Bytes& datagram : all) {
      endpoint_.feedDatagram(datagram, [this](const Event& event) { note(event); });
      rewrite(datagram, again);
    }
  }
  const std::map<std::string, int>& counts() const { return counts_; }
  const Peer& endpoint() const { return endpoint_; }

 private:
  void note(const Event& event) {
    if (const auto* message = std::get_if<MessageReceived>(&event)) {
      ++counts_[std::string(message->typeName)];
      types_[message->type.value] = message->kind;
      ASSERT_NE(message->kind, kUnknownKind) << message->typeName;
      const Result<Message> decoded = decode(message->kind, message->payload);
      ASSERT_TRUE(decoded) << decoded.error();
      EXPECT_EQ(encoded(*decoded), withoutStrayMemory(*decoded, message->payload)) << message->typeName;
    } else if (std::holds_alternative<SenderDescribed>(event)) {
      ++counts_["SENDER_DESCRIPTION"];
    } else if (std::holds_alternative<TypeDescribed>(event)) {
      ++counts_["TYPE_DESCRIPTION"];
    } else if (std::holds_alternative<UdpDescribed>(event)) {
      ++counts_["UDP_DESCRIPTION"];
    } else if (!std::holds_alternative<Connected>(event)) {
      ADD_FAILURE() << eventText(event);
    }
  }

  Bytes payloadAgain(const FrameView& frame) {
    switch (frame.header.type) {
      case kSenderDescription:
      case kTypeDescription:
        return encodeDescription(*decodeDescription(frame.payload));
      case kUdpDescription:
        return encodeUdpDescription(*decodeUdpDescription(frame.header.sender, frame.payload));
      default:
        return encoded(*decode(types_.at(frame.header.type), frame.payload));
    }
  }

  // Encodes every frame from its decoded content; header with sequence number and payload must be the same.
  void rewrite(ByteView frames, FrameEncoder& encoder) {
    encoder.clear();
    Bytes expected(frames.begin(), frames.end());
    std::size_t at = 0;
    FrameReader reader(frames);
    for (FrameView frame; reader.next(frame); at += frame.size) {
      encoder.addRaw(frame.header.time, frame.header.sender, frame.header.type, payloadAgain(frame));
      std::fill_n(expected.begin() + static_cast<std::ptrdiff_t>(at + frame.header.length),
                  frame.size - frame.header.length, std::byte{0});
      if (frame.header.type < 0) continue;
      const Message message = *decode(types_.at(frame.header.type), frame.payload);
      const Bytes clean = withoutStrayMemory(message, frame.payload);
      std::copy(clean.begin(), clean.end(),
                expected.begin() + static_cast<std::ptrdiff_t>(at + kHeaderBytes));
    }
    EXPECT_TRUE(reader.rest().empty());
    EXPECT_EQ(Bytes(encoder.bytes().begin(), encoder.bytes().end()), expected);
  }

  LocalNames names_;
  Peer endpoint_;
  std::map<std::string, int> counts_;
  std::map<std::int32_t, MessageKind> types_;
};

struct Recording {
  const char* conversation;
  const char* direction;
};

class Golden : public testing::TestWithParam<Recording> {};

TEST_P(Golden, IsUnderstoodAndWrittenAgain) {
  const std::string conversation = GetParam().conversation;
  const std::string direction = GetParam().direction;
  Listener listener;
  listener.stream(recorded(conversation + '.' + direction + ".tcp.bin"));
  EXPECT_EQ(listener.counts(), recordedCounts(conversation + ".index.txt", direction));
  if (conversation == "udp") {
    listener.datagrams(recordedDatagrams("udp." + direction + ".udp.bin"));
    EXPECT_EQ(listener.counts(), recordedCounts("udp.index.txt", direction + "/udp"));
  }
  EXPECT_TRUE(listener.endpoint().connected());
}

INSTANTIATE_TEST_SUITE_P(Recordings, Golden,
                         testing::Values(Recording{"tcp", "c2s"}, Recording{"tcp", "s2c"},
                                         Recording{"udp", "c2s"}, Recording{"udp", "s2c"}),
                         [](const auto& test) {
                           return std::string(test.param.conversation) + "_" + test.param.direction;
                         });

TEST(Golden, TheConnectionRequest) {
  const Bytes datagram = recorded("udp.lob.udp.bin");
  const Result<UdpRequest> request = parseUdpRequest(datagram);
  ASSERT_TRUE(request) << request.error();
  EXPECT_EQ(request->host, "127.0.0.1");
  EXPECT_EQ(request->port, 39685);
  EXPECT_EQ(formatUdpRequest(*request), asText(datagram));
}

TEST(Golden, CutAnywhereAStreamIsNeverAnError) {
  const Bytes stream = recorded("tcp.c2s.tcp.bin");
  const auto see = [&](std::initializer_list<ByteView> pieces) {
    LocalNames names;
    Peer endpoint(names);
    std::size_t hash = 0;
    const auto sink = [&](const Event& event) {
      hash = hash * 1000003 + std::hash<std::string>{}(eventText(event));
      EXPECT_FALSE(std::holds_alternative<ProtocolError>(event));
    };
    for (const ByteView piece : pieces) endpoint.feed(Time{}, piece, sink);
    return hash;
  };
  const ByteView all(stream);
  const std::size_t whole = see({all});
#ifdef HAPTICD_SANITIZED
  constexpr std::size_t kStep = 61;
#else
  constexpr std::size_t kStep = 1;
#endif
  for (std::size_t cut = 0; cut <= all.size(); cut += cut < 600 ? 1 : kStep) {
    ASSERT_EQ(see({all.first(cut), all.subspan(cut)}), whole) << "cut at " << cut;
  }
}

TEST(Golden, ByteByByteAStreamIsTheSame) {
  const Bytes stream = recorded("tcp.s2c.tcp.bin");
  LocalNames names;
  Peer whole(names);
  Peer drops(names);
  std::vector<std::string> expected;
  std::vector<std::string> seen;
  whole.feed(Time{}, stream, [&](const Event& event) { expected.push_back(eventText(event)); });
  for (const std::byte& byte : stream) {
    drops.feed(Time{}, {&byte, 1}, [&](const Event& event) { seen.push_back(eventText(event)); });
  }
  EXPECT_EQ(seen, expected);
  EXPECT_GT(seen.size(), 150U);
}

}  // namespace
}  // namespace hapticd::wire

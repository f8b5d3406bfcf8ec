// Frames: headers, padding, limits, and whole frames cut into datagrams.
#include "wire/frame.h"

#include <gtest/gtest.h>

#include "wire/frame_encoder.h"
#include "wire/recording.h"

namespace hapticd::wire {
namespace {

TEST(Frames, CarryTheHeaderAsVrpnDoes) {
  FrameEncoder encoder;
  encoder.add(Time{10, 20}, LocalSender{3}, Dop{0.5});
  encoder.add(Time{11, 21}, LocalSender{4}, Message(IsTouching{1}));
  FrameReader reader(encoder.bytes());
  FrameView frame;
  ASSERT_TRUE(reader.next(frame));
  EXPECT_EQ(frame.header.length, 32U);
  EXPECT_EQ(frame.header.time, (Time{10, 20}));
  EXPECT_EQ(frame.header.sender, 3);
  EXPECT_EQ(frame.header.type, kLocalType<Dop>.value);
  EXPECT_EQ(frame.header.sequence, 0U);
  EXPECT_EQ(decode<Dop>(frame.payload)->depth, 0.5);
  ASSERT_TRUE(reader.next(frame));
  EXPECT_EQ(frame.header.length, 26U);
  EXPECT_EQ(frame.size, 32U) << "padded to 8";
  EXPECT_EQ(frame.header.sequence, 1U);
  EXPECT_FALSE(reader.next(frame));
  EXPECT_EQ(reader.status(), FrameStatus::kIncomplete);
  EXPECT_TRUE(reader.rest().empty());
}

TEST(Frames, WithImpossibleLengthsAreInvalidAtOnce) {
  FrameView frame;
  for (const std::uint32_t length : {0U, 23U, 64025U, 0x7fffffffU, 0xffffffffU}) {
    Bytes bytes(4);
    storeBig(bytes.data(), length);
    EXPECT_EQ(readFrame(bytes, frame), FrameStatus::kInvalid) << length;
    EXPECT_EQ(invalidFrame(bytes), "frame length " + std::to_string(length) + " is outside 24 to 64024");
  }
}

TEST(Frames, UpToTheLimitAreAccepted) {
  Bytes bytes(kHeaderBytes + kMaxPayloadBytes);
  storeBig<std::uint32_t>(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  FrameView frame;
  EXPECT_EQ(readFrame(ByteView(bytes).first(bytes.size() - 1), frame), FrameStatus::kIncomplete);
  EXPECT_EQ(readFrame(bytes, frame), FrameStatus::kComplete);
  EXPECT_EQ(frame.payload.size(), kMaxPayloadBytes);
}

TEST(Frames, WithoutAllTheirPaddingAreIncomplete) {
  FrameEncoder encoder;
  encoder.add(Time{}, LocalSender{0}, IsTouching{1});
  FrameView frame;
  for (std::size_t size = 0; size < encoder.bytes().size(); ++size) {
    EXPECT_EQ(readFrame(encoder.bytes().first(size), frame), FrameStatus::kIncomplete) << size;
  }
}

TEST(FrameEncoders, RefuseWhatNoPeerAcceptsAndStayWhole) {
  FrameEncoder encoder;
  encoder.add(Time{}, LocalSender{0}, Dop{});
  ButtonStates tooMany;
  tooMany.states.values.resize(257);
  EXPECT_THROW(encoder.add(Time{}, LocalSender{0}, tooMany), std::length_error);
  EXPECT_THROW(encoder.addRaw(Time{}, 0, 0, Bytes(kMaxPayloadBytes + 1)), std::length_error);
  EXPECT_EQ(encoder.bytes().size(), 32U);
  encoder.addRaw(Time{}, 0, 0, Bytes(kMaxPayloadBytes));
  EXPECT_EQ(encoder.bytes().size(), 32U + kHeaderBytes + kMaxPayloadBytes);
}

TEST(FrameEncoders, ClearedCountOn) {
  FrameEncoder encoder;
  encoder.add(Time{}, LocalSender{0}, Dop{});
  encoder.clear();
  EXPECT_TRUE(encoder.empty());
  encoder.add(Time{}, LocalSender{0}, Dop{});
  EXPECT_EQ(loadHeader(encoder.bytes().data()).sequence, 1U);
}

TEST(Datagrams, HoldAsManyWholeFramesAsFit) {
  FrameEncoder encoder;
  for (int i = 0; i < 50; ++i) encoder.add(Time{}, LocalSender{0}, TrackerPosQuat{});
  std::vector<std::size_t> sizes;
  Bytes joined;
  cutDatagrams(encoder.bytes(), [&](ByteView datagram) {
    sizes.push_back(datagram.size());
    joined.insert(joined.end(), datagram.begin(), datagram.end());
  });
  EXPECT_EQ(sizes, (std::vector<std::size_t>{1408, 1408, 1408, 176}));  // 16 frames of 88 bytes fit
  EXPECT_EQ(joined, Bytes(encoder.bytes().begin(), encoder.bytes().end()));
  cutDatagrams({}, [](ByteView) { ADD_FAILURE() << "a datagram of nothing"; });
}

TEST(Datagrams, FillExactly) {
  FrameEncoder encoder;
  encoder.addRaw(Time{}, 0, 0, Bytes(kMaxDatagramBytes - 32 - kHeaderBytes));
  encoder.add(Time{}, LocalSender{0}, Dop{});
  int count = 0;
  cutDatagrams(encoder.bytes(), [&](ByteView datagram) {
    EXPECT_EQ(datagram.size(), kMaxDatagramBytes);
    ++count;
  });
  EXPECT_EQ(count, 1);
}

}  // namespace
}  // namespace hapticd::wire

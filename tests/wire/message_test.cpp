// Messages as values: copies own what they hold.
#include "wire/message.h"

#include <gtest/gtest.h>

#include <vector>

#include "wire/codec.h"
#include "wire/recording.h"

namespace hapticd::wire {
namespace {

// Long enough that a std::string allocates.
const std::string kLong(200, 'x');

TEST(Messages, GiveTheStructOfTheirKindOnly) {
  const Message message = ButtonChange{3, 1};
  EXPECT_EQ(message.kind(), kindOf<ButtonChange>);
  ASSERT_NE(message.as<ButtonChange>(), nullptr);
  EXPECT_EQ(message.as<ButtonChange>()->button, 3);
  EXPECT_EQ(message.as<ButtonAlert>(), nullptr);
}

TEST(Messages, StartWithTheDefaultsOfTheirKind) {
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    const MessageKind kind{static_cast<std::uint8_t>(i)};
    EXPECT_EQ(Message(kind).kind(), kind);
  }
  EXPECT_EQ(Message(kindOf<TouchedObject>).as<TouchedObject>()->object, -1);
  EXPECT_EQ(Message(kindOf<Scp>).as<Scp>()->orientation, (F64x4{0, 0, 0, 1}));
}

TEST(Messages, AreCopiedDeeply) {
  Message first = Text{kTextWarning, 1, kLong};
  const Message copy = first;
  first = CustomEffect{7, {{1, 2, 3}}};
  ASSERT_NE(copy.as<Text>(), nullptr);
  EXPECT_EQ(copy.as<Text>()->text.text, kLong);
  EXPECT_EQ(first.as<CustomEffect>()->parameters.values, (std::vector<float>{1, 2, 3}));
  first = copy;
  EXPECT_EQ(first.as<Text>()->text.text, kLong);
  const Message& same = first;
  first = same;
  EXPECT_EQ(first.as<Text>()->text.text, kLong);
}

TEST(Messages, AreMovedWithWhatTheyHold) {
  Message first = ButtonStates{{std::vector<std::int32_t>(256, 1)}};
  const std::int32_t* values = first.as<ButtonStates>()->states.values.data();
  const Message second = std::move(first);
  EXPECT_EQ(second.as<ButtonStates>()->states.values.data(), values);
  std::vector<Message> all;
  for (int i = 0; i < 100; ++i) all.emplace_back(Text{0, static_cast<std::uint32_t>(i), kLong});
  for (std::uint32_t i = 0; i < 100; ++i) EXPECT_EQ(all[i].as<Text>()->level, i);
}

TEST(Messages, AreEncodedAsTheirStruct) {
  const Effect effect{"spring", 3, 0.5, 1, 2, 3, {4, 5, 6}, {7, 8, 9}};
  Bytes direct(payloadSize(effect));
  encodePayload(effect, direct.data());
  EXPECT_EQ(encoded(Message(effect)), direct);
  ButtonStates tooMany;
  tooMany.states.values.resize(257);
  EXPECT_THROW((void)payloadSize(Message(tooMany)), std::length_error);
}

TEST(Messages, KeepTheirStructWhenAPayloadIsMalformed) {
  Heartbeat heartbeat{5};
  EXPECT_FALSE(decodeInto(kindOf<Heartbeat>, Bytes(3), &heartbeat));
  EXPECT_EQ(heartbeat.watch, 5);
  EXPECT_TRUE(decodeInto(kindOf<Heartbeat>, Bytes(2), &heartbeat));
  EXPECT_EQ(heartbeat.watch, 0);
  EXPECT_EQ(decodeInto(kUnknownKind, {}, &heartbeat).error(), "message kind 255 is not in the table");
}

}  // namespace
}  // namespace hapticd::wire

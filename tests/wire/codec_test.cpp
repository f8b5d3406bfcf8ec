// Payloads: sizes, round trips, and what is refused.
#include "wire/codec.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <limits>

#include "wire/describe.h"
#include "wire/fields.h"
#include "wire/recording.h"

namespace hapticd::wire {
namespace {

std::vector<MessageKind> allKinds() {
  std::vector<MessageKind> kinds;
  for (std::size_t i = 0; i < kMessageKinds; ++i) kinds.push_back(MessageKind{static_cast<std::uint8_t>(i)});
  return kinds;
}

// Payload sizes as the stock and UMA libraries check them; lists empty.
const std::map<std::string, std::size_t> kSizes = {
    {"vrpn_Base text_message", 1032},
    {"vrpn_Base ping_message", 0},
    {"vrpn_Base pong_message", 0},
    {"vrpn_ForceDevice Force", 24},
    {"vrpn_ForceDevice SCP", 56},
    {"vrpn_ForceDevice Force_Error", 4},
    {"vrpn_ForceDevice Force_Field", 64},
    {"vrpn_ForceDevice Plane", 40},
    {"vrpn_ForceDevice Plane2", 24},
    {"vrpn_ForceDevice addObject", 8},
    {"vrpn_ForceDevice addObjectExScene", 4},
    {"vrpn_ForceDevice moveToParent", 8},
    {"vrpn_ForceDevice setObjectPosition", 16},
    {"vrpn_ForceDevice setObjectOrientation", 20},
    {"vrpn_ForceDevice setObjectScale", 16},
    {"vrpn_ForceDevice removeObject", 4},
    {"vrpn_ForceDevice setVertex", 20},
    {"vrpn_ForceDevice setNormal", 20},
    {"vrpn_ForceDevice setTriangle", 32},
    {"vrpn_ForceDevice removeTriangle", 8},
    {"vrpn_ForceDevice updateTrimeshChanges", 20},
    {"vrpn_ForceDevice transformTrimesh", 68},
    {"vrpn_ForceDevice setTrimeshType", 8},
    {"vrpn_ForceDevice clearTrimesh", 4},
    {"vrpn_ForceDevice setHapticOrigin", 28},
    {"vrpn_ForceDevice setHapticScale", 4},
    {"vrpn_ForceDevice setSceneOrigin", 28},
    {"vrpn_ForceDevice getNewObjectID", 0},
    {"vrpn_ForceDevice setObjectIsTouchable", 6},
    {"vrpn_ForceDevice Custom Effect", 8},
    {"vrpn_ForceDevice constraint_enable", 4},
    {"vrpn_ForceDevice constraint_mode", 4},
    {"vrpn_ForceDevice constraint_point", 12},
    {"vrpn_ForceDevice constraint_linept", 12},
    {"vrpn_ForceDevice constraint_linedir", 12},
    {"vrpn_ForceDevice constraint_plpt", 12},
    {"vrpn_ForceDevice constraint_plnorm", 12},
    {"vrpn_ForceDevice constraint_KSpring", 4},
    {"vrpn_ForceDevice setWorkspaceBoundingBox", 176},
    {"vrpn_ForceDevice setWorkspaceProjectionMatrix", 256},
    {"vrpn_ForceDevice setObjectNumber", 4},
    {"vrpn_ForceDevice setTransformMatrix", 132},
    {"vrpn_ForceDevice setHapticProperty", 28},
    {"vrpn_ForceDevice setTouchableFace", 4},
    {"vrpn_ForceDevice Effect", 104},
    {"vrpn_ForceDevice startEffect", 4},
    {"vrpn_ForceDevice stopEffect", 4},
    {"vrpn_ForceDevice resetScene", 1},
    {"vrpn_ForceDevice DOP", 8},
    {"vrpn_ForceDevice isTouching", 2},
    {"vrpn_ForceDevice TouchedObject", 4},
    {"vrpn_ForceDevice Angle", 10},
    {"vrpn_Tracker Pos_Quat", 64},
    {"vrpn_Tracker Velocity", 72},
    {"vrpn_Tracker Acceleration", 72},
    {"vrpn_Tracker To_Room", 56},
    {"vrpn_Tracker Unit_To_Sensor", 64},
    {"vrpn_Tracker Workspace", 48},
    {"vrpn_Tracker Request_Tracker_To_Room", 0},
    {"vrpn_Tracker Request_Unit_To_Sensor", 0},
    {"vrpn_Tracker Request_Tracker_Workspace", 0},
    {"vrpn_Tracker set_update_rate", 8},
    {"vrpn_Tracker Reset_Origin", 0},
    {"vrpn_Button Change", 8},
    {"vrpn_Button States", 4},
    {"vrpn_Button Admin", 8},
    {"vrpn_Button Alert", 8},
    {"vrpn_Analog Channel", 8},
};

TEST(Table, HasEveryMessageWithTheSizeTheStockLibraryChecks) {
  std::map<std::string, std::size_t> sizes;
  for (const MessageDescription& message : describeMessages()) {
    sizes[std::string(message.info.name)] = message.payload_bytes;
    EXPECT_EQ(payloadSize(Message(message.kind)), message.payload_bytes) << message.info.name;
  }
  EXPECT_EQ(sizes.size(), kMessageKinds) << "two messages of one name";
  // Our own extensions are not the stock library's business.
  std::erase_if(sizes, [](const auto& entry) { return entry.first.starts_with("hapticd "); });
  EXPECT_EQ(sizes, kSizes);
}

TEST(Table, FindsKindsByName) {
  EXPECT_EQ(kindNamed("vrpn_ForceDevice setVertex"), kindOf<SetVertex>);
  EXPECT_EQ(kindNamed("vrpn_ForceDevice setvertex"), kUnknownKind);
  EXPECT_EQ(kindNamed(""), kUnknownKind);
  EXPECT_EQ(info(kindOf<Effect>).reliability, Reliability::kLowLatency);
  EXPECT_EQ(Message(Pong{}).kind(), kindOf<Pong>);
}

// Draws every field at random.
class Randomizer final : public FieldVisitor {
 public:
  void number(const Field&, const Numbers& one) override { draw(one); }
  void array(const Field&, const Numbers& values) override { draw(values); }
  void name(const Field&, std::span<char> bytes) override {
    const std::string text = drawText().substr(0, bytes.size());
    std::fill(std::copy(text.begin(), text.end(), bytes.begin()), bytes.end(), '\0');
  }
  void text(const Field&, std::size_t, std::string& value) override { value = drawText(); }
  void list(const Field&, const NumberList& list) override {
    list.resize(*rc::gen::inRange<std::size_t>(0, std::min<std::size_t>(list.most, 100) + 1));
    draw(list.values());
  }

 private:
  static void draw(const Numbers& numbers) {
    numbers.with([]<class T>(std::span<T> values) {
      for (T& value : values) value = *rc::gen::arbitrary<T>();
    });
  }
  static std::string drawText() {
    const auto text = *rc::gen::string<std::string>();
    return text.substr(0, text.find('\0'));
  }
};

// The fields as text, so that equality does not lean on the encoder it judges.
class FieldsAsText final : public FieldVisitor {
 public:
  void number(const Field& field, const Numbers& one) override { print(field, one); }
  void array(const Field& field, const Numbers& values) override { print(field, values); }
  void name(const Field& field, std::span<char> bytes) override {
    out << field.name << '=' << std::string(bytes.data(), bytes.size()) << ' ';
  }
  void text(const Field& field, std::size_t, std::string& value) override {
    out << field.name << '=' << value << ' ';
  }
  void list(const Field& field, const NumberList& list) override { print(field, list.values()); }

  std::ostringstream out;

 private:
  void print(const Field& field, const Numbers& numbers) {
    numbers.with([&]<class T>(std::span<T> values) {
      for (const T& value : values) out << field.name << '=' << std::hexfloat << +value << ' ';
    });
  }
};

std::string fieldsAsText(Message message) {
  FieldsAsText text;
  visitFields(message, text);
  return text.out.str();
}

void expectRoundTrip(MessageKind kind) {
  Message message(kind);
  Randomizer randomizer;
  visitFields(message, randomizer);
  const Bytes bytes = encoded(message);
  const Result<Message> decoded = decode(kind, bytes);
  RC_ASSERT(decoded);
  RC_ASSERT(decoded->kind() == kind);
  RC_ASSERT(fieldsAsText(*decoded) == fieldsAsText(message));
  RC_ASSERT(encoded(*decoded) == bytes);
}

TEST(Codec, EveryMessageSurvivesTheRoundTrip) {
  for (const MessageKind kind : allKinds()) {
    EXPECT_TRUE(rc::check(std::string(info(kind).name), [kind] { expectRoundTrip(kind); }))
        << info(kind).name;
  }
}

// The same code as for every other message, without the table between.
template <class M>
void expectTypedRoundTrip(const M& message) {
  const Bytes bytes = encoded(message);
  ASSERT_EQ(bytes.size(), payloadSize(message));
  const Result<M> decoded = decode<M>(bytes);
  ASSERT_TRUE(decoded) << decoded.error();
  EXPECT_EQ(*decoded, message);
  EXPECT_EQ(fieldsAsText(*decoded), fieldsAsText(message));
}

TEST(Codec, ReadsStructsWithoutTheTable) {
  expectTypedRoundTrip(StopForces{});
  expectTypedRoundTrip(SetVertex{-1, 0x7fffffff, {1, -0.0F, std::numeric_limits<float>::quiet_NaN()}});
  expectTypedRoundTrip(Text{kTextError, 7, "text"});
  expectTypedRoundTrip(Effect{"spring", 3, 0.5, 1, 2, 3, {4, 5, 6}, {7, 8, 9}});
  expectTypedRoundTrip(CustomEffect{4, {{1, 2, 3}}});
  expectTypedRoundTrip(ContactList{1, -2, {}});
}

TEST(Codec, RefusesEveryOtherLengthOfAFixedMessage) {
  const Bytes zeros(2000);
  for (const MessageDescription& description : describeMessages()) {
    for (std::size_t size = 0; size <= description.payload_bytes + 16; ++size) {
      const Result<Message> message = decode(description.kind, ByteView(zeros).first(size));
      const bool valid =
          description.counted ? size >= description.payload_bytes : size == description.payload_bytes;
      ASSERT_EQ(static_cast<bool>(message), valid) << description.info.name << ' ' << size;
      if (valid) continue;
      EXPECT_NE(message.error().find(description.info.name), std::string::npos);
      EXPECT_NE(message.error().find("payload of " + std::to_string(size) + " bytes"), std::string::npos);
    }
  }
}

TEST(Codec, SaysWhatIsWrong) {
  EXPECT_EQ(decode<SetVertex>(Bytes(19)).error(),
            "vrpn_ForceDevice setVertex: payload of 19 bytes, expected 20");
  EXPECT_EQ(decode<ButtonStates>(Bytes(3)).error(),
            "vrpn_Button States: payload of 3 bytes, expected at least 4");
  EXPECT_EQ(decode(kUnknownKind, {}).error(), "message kind 255 is not in the table");
}

TEST(Codec, WritesBigEndianWithoutAlignment) {
  const Bytes bytes = encoded(SetVertex{1, 0x01020304, {1.0F, -2.0F, 0.0F}});
  const std::array<int, 20> expected = {0, 0, 0, 1, 1, 2, 3, 4, 0x3f, 0x80, 0, 0, 0xc0, 0, 0, 0, 0, 0, 0, 0};
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_EQ(std::to_integer<int>(bytes[i]), expected[i]) << i;
  EXPECT_EQ(encoded(Angle{1.0, 1}),
            (Bytes{std::byte{0x3f}, std::byte{0xf0}, {}, {}, {}, {}, {}, {}, {}, std::byte{1}}));
}

TEST(Names, EndAtTheFirstNulAndNeverBehindTheirBytes) {
  Bytes payload = encoded(SetHapticProperty{0, "mass", 0.5F});
  std::fill(payload.begin() + 4 + 5, payload.begin() + 24, std::byte{'x'});
  const Result<SetHapticProperty> garbage = decode<SetHapticProperty>(payload);
  ASSERT_TRUE(garbage);
  EXPECT_EQ(garbage->property.view(), "mass");
  EXPECT_EQ(garbage->value, 0.5F);
  EXPECT_EQ(encoded(*garbage), encoded(SetHapticProperty{0, "mass", 0.5F}));

  payload[4 + 4] = std::byte{'x'};
  const Result<SetHapticProperty> full = decode<SetHapticProperty>(payload);
  ASSERT_TRUE(full);
  EXPECT_EQ(full->property.view(), "massxxxxxxxxxxxxxxxx");
  EXPECT_EQ(full->property.view().size(), 20U);

  EXPECT_EQ(NameBuffer<20>("a name of more than twenty characters").view(), "a name of more than ");
  EXPECT_EQ(NameBuffer<20>("").view(), "");
}

TEST(TextMessages, AlwaysFill1032BytesAndEndInNul) {
  const Bytes shorter = encoded(Text{kTextWarning, 7, "abc"});
  ASSERT_EQ(shorter.size(), 1032U);
  EXPECT_TRUE(
      std::all_of(shorter.begin() + 8 + 3, shorter.end(), [](std::byte b) { return b == std::byte{0}; }));

  const Bytes longer = encoded(Text{kTextError, 0, std::string(5000, 'y')});
  ASSERT_EQ(longer.size(), 1032U);
  EXPECT_EQ(longer.back(), std::byte{0});
  EXPECT_EQ(decode<Text>(longer)->text.text, std::string(1023, 'y'));

  Bytes unterminated = longer;
  unterminated.back() = std::byte{'y'};
  EXPECT_EQ(decode<Text>(unterminated)->text.text.size(), 1024U);
}

TEST(ResetSceneMessages, KeepTheirMeaninglessByte) {
  const Bytes byte{std::byte{0xa5}};
  EXPECT_EQ(encoded(*decode(kindOf<ResetScene>, byte)), byte);
}

TEST(Lists, MayBeFollowedByBytesThatAreIgnored) {
  Bytes payload = encoded(CustomEffect{4, {{1, 2, 3}}});
  EXPECT_EQ(payload.size(), 20U);
  payload.resize(33);
  const Result<CustomEffect> effect = decode<CustomEffect>(payload);
  ASSERT_TRUE(effect);
  EXPECT_EQ(effect->effect, 4U);
  EXPECT_EQ(effect->parameters.values, (std::vector<float>{1, 2, 3}));
}

TEST(Lists, CannotClaimMoreThanThereIs) {
  Bytes payload = encoded(CustomEffect{0, {{1, 2, 3}}});
  storeBig<std::uint32_t>(payload.data() + 4, 4);
  EXPECT_EQ(decode<CustomEffect>(payload).error(),
            "vrpn_ForceDevice Custom Effect: parameters counts 4 values, room for 3, at most 15998");
  storeBig<std::uint32_t>(payload.data() + 4, 0xffffffff);
  EXPECT_FALSE(decode<CustomEffect>(payload));

  Bytes states(4 + 4 * 300);
  storeBig<std::int32_t>(states.data(), -1);
  EXPECT_EQ(decode<ButtonStates>(states).error(),
            "vrpn_Button States: states counts -1 values, room for 300, at most 256");
  storeBig<std::int32_t>(states.data(), 257);
  EXPECT_FALSE(decode<ButtonStates>(states));
  storeBig<std::int32_t>(states.data(), 256);
  EXPECT_TRUE(decode<ButtonStates>(states));
}

TEST(Lists, CountedInFloatsTakeOnlyWholeNumbers) {
  const Bytes three = encoded(AnalogChannels{{{1.5, 2.5, 3.5}}});
  ASSERT_EQ(three.size(), 32U);
  EXPECT_EQ(loadBig<double>(three.data()), 3.0);
  for (const double count : {-1.0, 2.5, 4.0, 1e300, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()}) {
    Bytes bad = three;
    storeBig(bad.data(), count);
    EXPECT_FALSE(decode<AnalogChannels>(bad)) << count;
  }
}

TEST(Lists, TooLongToSendThrow) {
  ButtonStates states;
  states.states.values.resize(257);
  EXPECT_THROW((void)payloadSize(states), std::length_error);
}

}  // namespace
}  // namespace hapticd::wire

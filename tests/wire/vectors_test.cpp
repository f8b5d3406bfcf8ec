// The test vectors in testdata/wire/vectors.json: fields to bytes and bytes to fields.
#include "wire/vectors.h"

#include <gtest/gtest.h>

#include <iomanip>
#include <nlohmann/json.hpp>

#include "wire/describe.h"
#include "wire/fields.h"
#include "wire/frame_encoder.h"
#include "wire/recording.h"

namespace hapticd::wire {
namespace {

using Json = nlohmann::json;

std::string hex(ByteView bytes) {
  std::ostringstream out;
  for (const std::byte byte : bytes)
    out << std::hex << std::setw(2) << std::setfill('0') << std::to_integer<int>(byte);
  return out.str();
}

Bytes unhex(const std::string& text) {
  Bytes bytes;
  for (std::size_t i = 0; i < text.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(text.substr(i, 2), nullptr, 16)));
  return bytes;
}

// 64-bit integers are text in the file.
template <class T>
T numberOf(const Json& json) {
  if (!json.is_string()) return json.get<T>();
  if constexpr (std::is_signed_v<T>) return static_cast<T>(std::stoll(json.get<std::string>()));
  return static_cast<T>(std::stoull(json.get<std::string>()));
}

// Sets the fields of a message from JSON.
class FieldsFromJson final : public FieldVisitor {
 public:
  explicit FieldsFromJson(const Json& fields) : fields_(fields) {}

  void number(const Field& field, const Numbers& one) override {
    one.with([&]<class T>(std::span<T> values) { values[0] = numberOf<T>(of(field)); });
  }
  void array(const Field& field, const Numbers& values) override { set(field, values); }
  void name(const Field& field, std::span<char> bytes) override {
    const auto text = of(field).get<std::string>();
    std::fill(std::copy(text.begin(), text.end(), bytes.begin()), bytes.end(), '\0');
  }
  void text(const Field& field, std::size_t, std::string& value) override { value = of(field); }
  void list(const Field& field, const NumberList& list) override {
    list.resize(of(field).size());
    set(field, list.values());
  }

 private:
  const Json& of(const Field& field) const { return fields_.at(std::string(field.name)); }
  void set(const Field& field, const Numbers& numbers) {
    numbers.with([&]<class T>(std::span<T> values) {
      ASSERT_EQ(values.size(), of(field).size());
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = numberOf<T>(of(field)[i]);
    });
  }

  const Json& fields_;
};

// Compares the fields of a message with JSON.
class FieldsEqualJson final : public FieldVisitor {
 public:
  explicit FieldsEqualJson(const Json& fields) : fields_(fields) {}

  void number(const Field& field, const Numbers& one) override {
    one.with(
        [&]<class T>(std::span<T> values) { EXPECT_EQ(values[0], numberOf<T>(of(field))) << field.name; });
  }
  void array(const Field& field, const Numbers& values) override { compare(field, values); }
  void name(const Field& field, std::span<char> bytes) override {
    const std::string_view all(bytes.data(), bytes.size());
    EXPECT_EQ(all.substr(0, all.find('\0')), of(field).get<std::string>()) << field.name;
  }
  void text(const Field& field, std::size_t, std::string& value) override {
    EXPECT_EQ(value, of(field).get<std::string>()) << field.name;
  }
  void list(const Field& field, const NumberList& list) override { compare(field, list.values()); }

 private:
  const Json& of(const Field& field) const { return fields_.at(std::string(field.name)); }
  void compare(const Field& field, const Numbers& numbers) {
    numbers.with([&]<class T>(std::span<T> values) {
      ASSERT_EQ(values.size(), of(field).size()) << field.name;
      for (std::size_t i = 0; i < values.size(); ++i)
        EXPECT_EQ(values[i], numberOf<T>(of(field)[i])) << field.name << ' ' << i;
    });
  }

  const Json& fields_;
};

std::string vectorsFile() {
  std::ifstream in(HAPTICD_TESTDATA "/wire/vectors.json");
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(Vectors, AreWhatTheTableGives) {
  EXPECT_TRUE(vectorsFile() == vectorsAsJson()) << "run wire_docs vectors > testdata/wire/vectors.json";
}

TEST(Vectors, AreEncodedAndDecoded) {
  std::map<std::string, int> counts;
  for (const Json& vector : Json::parse(vectorsFile())) {
    SCOPED_TRACE(vector.at("name"));
    const MessageKind kind = kindNamed(vector.at("name").get<std::string>());
    ASSERT_NE(kind, kUnknownKind);
    ++counts[vector.at("name")];
    const Bytes payload = unhex(vector.at("payload"));

    Message message(kind);
    FieldsFromJson fill(vector.at("fields"));
    visitFields(message, fill);
    EXPECT_EQ(hex(encoded(message)), vector.at("payload").get<std::string>());
    const Json& header = vector.at("header");
    FrameEncoder encoder;
    encoder.add({header.at("seconds"), header.at("microseconds")}, LocalSender{header.at("sender")}, message);
    EXPECT_EQ(hex(encoder.bytes()), vector.at("frame").get<std::string>());

    Result<Message> decoded = decode(kind, payload);
    ASSERT_TRUE(decoded) << decoded.error();
    Message again = *std::move(decoded);
    FieldsEqualJson compare(vector.at("fields"));
    visitFields(again, compare);

    const Bytes bytes = unhex(vector.at("frame"));
    FrameView frame;
    ASSERT_EQ(readFrame(bytes, frame), FrameStatus::kComplete);
    EXPECT_EQ(frame.size, bytes.size());
    EXPECT_EQ(hex(frame.payload), vector.at("payload").get<std::string>());
    EXPECT_EQ(frame.header.length, header.at("length"));
    EXPECT_EQ(frame.header.sender, header.at("sender"));
    EXPECT_EQ(frame.header.type, header.at("type"));
    EXPECT_EQ(frame.header.time, (Time{header.at("seconds"), header.at("microseconds")}));
  }
  EXPECT_EQ(counts.size(), kMessageKinds);
  for (const auto& [name, count] : counts) {
    EXPECT_EQ(count, payloadSize(Message(kindNamed(name))) == 0 ? 1 : 4) << name;
  }
}

// Bytes that were computed by hand from docs/wire-messages.md.
TEST(Vectors, HoldTheseBytes) {
  const std::map<std::string, std::string> byHand = {
      {"hapticd Stop_Forces", ""},
      // 257, -514, then 3/8, -4/8 and 5/8 as floats
      {"vrpn_ForceDevice setVertex",
       "00000101"
       "fffffdfe"
       "3ec00000"
       "bf000000"
       "3f200000"},
      // "spring", 257, -2/8
      {"vrpn_ForceDevice setHapticProperty",
       "00000101"
       "737072696e67"
       "0000000000000000000000000000"
       "be800000"},
      // 1/8, -514
      {"vrpn_ForceDevice Angle",
       "3fc0000000000000"
       "fdfe"},
      // 257 unsigned, -2/8
      {"hapticd Subscribe",
       "00000101"
       "bfd0000000000000"},
      {"hapticd Guard_State",
       "00000101"
       "00000202"
       "0303"
       "fbfc"},
  };
  std::map<std::string, std::string> found;
  for (const Json& vector : Json::parse(vectorsFile())) {
    const std::string name = vector.at("name");
    const bool distinct = vector.at("header").at("sender") == 1 || vector.at("payload") == "";
    if (distinct && byHand.contains(name)) found[name] = vector.at("payload");
  }
  EXPECT_EQ(found, byHand);
}

TEST(TypeScript, IsWhatTheTableGives) {
  std::ifstream in(HAPTICD_TESTDATA "/../web/src/wire/messages.ts");
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  EXPECT_TRUE(text == messagesAsTypeScript()) << "stale: run wire_docs typescript > web/src/wire/messages.ts";
}

}  // namespace
}  // namespace hapticd::wire

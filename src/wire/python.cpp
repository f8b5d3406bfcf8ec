#include "hapticd/trips.h"
#include "wire/describe.h"
#include "wire/fields.h"
#include "wire/named_bits.h"

namespace hapticd::wire {

namespace {

constexpr std::string_view kIntroduction =
    R"("""Every message of the wire as a named tuple, and its layout.

Written by `wire_docs python` from the table in src/wire/messages.h; do not edit. Fields are named as in
docs/wire-messages.md.
"""
# mypy: disable-error-code="assignment,misc"
# Fields named `count` and `index` hide methods of tuple.

from typing import Any, Final, NamedTuple, Tuple

from ._codec import Layout, Numbers, Vec3, Vec4, define

)";

// The letter of Python's struct module for a number.
std::string_view letterOf(NumberType type) {
  switch (type) {
    case NumberType::u8:
      return "B";
    case NumberType::i16:
      return "h";
    case NumberType::i32:
      return "i";
    case NumberType::u32:
      return "I";
    case NumberType::i64:
      return "q";
    case NumberType::u64:
      return "Q";
    case NumberType::f32:
      return "f";
    case NumberType::f64:
      break;
  }
  return "d";
}

bool isFloat(NumberType type) {
  return type == NumberType::f32 || type == NumberType::f64;
}

std::string quoted(std::string_view text) {
  return '"' + std::string(text) + '"';
}

// The members of the class and the rows of the layout, field by field. A default is what an empty struct has.
class FieldPrinter final : public FieldVisitor {
 public:
  void number(const Field& field, const Numbers& one) override {
    const bool real = isFloat(one.type);
    add(field, real ? "float" : "int", valueOf(one), quoted(letterOf(one.type)));
  }
  void array(const Field& field, const Numbers& values) override {
    const bool vector = isFloat(values.type) && (values.count == 3 || values.count == 4);
    const std::string type = vector ? "Vec" + std::to_string(values.count) : "Numbers";
    add(field, type, '(' + valueOf(values) + ')',
        quoted(letterOf(values.type)) + ", " + std::to_string(values.count));
  }
  void name(const Field& field, std::span<char> bytes) override {
    add(field, "str", "\"\"", "\"name\", " + std::to_string(bytes.size()));
  }
  void text(const Field& field, std::size_t bytes, std::string&) override {
    add(field, "str", "\"\"", "\"text\", " + std::to_string(bytes));
  }
  void list(const Field& field, const NumberList& list) override {
    add(field, "Numbers", "()",
        quoted("list" + std::string(letterOf(list.countType)) + std::string(letterOf(list.type))) + ", " +
            std::to_string(list.most));
  }

  std::string members;
  std::string rows;

 private:
  static std::string valueOf(const Numbers& numbers) {
    std::string text;
    numbers.with([&]<class T>(std::span<T> values) {
      for (const T value : values) {
        if (!text.empty()) text += ", ";
        const auto whole = static_cast<std::int64_t>(value);
        text += std::floating_point<T> && static_cast<T>(whole) != value ? std::to_string(value)
                                                                         : std::to_string(whole);
        if (std::floating_point<T> && static_cast<T>(whole) == value) text += ".0";
      }
    });
    return text;
  }
  void add(const Field& field, const std::string& type, const std::string& value, const std::string& layout) {
    members += "    " + std::string(field.name) + ": " + type + " = " + value;
    if (!field.unit.empty()) members += "  # " + std::string(field.unit);
    members += "\n";
    rows += "        (" + quoted(field.name) + ", " + layout + "),\n";
  }
};

}  // namespace

std::string messagesAsPython() {
  std::string text(kIntroduction);
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    Message message{MessageKind{static_cast<std::uint8_t>(i)}};
    const MessageInfo& about = info(message.kind());
    FieldPrinter fields;
    visitFields(message, fields);
    text += "\nclass " + std::string(structName(message.kind())) + "(NamedTuple):\n    \"\"\"" +
            std::string(about.meaning) + "\"\"\"\n";
    if (!fields.members.empty()) text += "\n" + fields.members;
    text += "\n";
  }
  text += "\n#: The layout of every message, in the order of the table.\n";
  text += "LAYOUTS: Final[Tuple[Layout[Any], ...]] = (\n";
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    Message message{MessageKind{static_cast<std::uint8_t>(i)}};
    const MessageInfo& about = info(message.kind());
    FieldPrinter fields;
    visitFields(message, fields);
    text += "    define(" + std::string(structName(message.kind())) + ", " + quoted(about.name) + ", (";
    text += fields.rows.empty() ? ")" : "\n" + fields.rows + "    )";
    text += "),\n";
  }
  text += ")\n\n";
  const auto constant = [&](std::string_view name, std::size_t value) {
    text += std::string(name) + ": Final = " + std::to_string(value) + "\n";
  };
  text += "#: Vertices or triangles in one message at most.\n";
  constant("MOST_IN_ONE_MESSAGE", MeshVertices::kMost);
  text += "#: The effect of CustomEffect that stops it.\n";
  constant("STOP_CUSTOM_EFFECT", kStopCustomEffect);
  text += "#: Bits of Subscribe.kinds.\n";
  for (const NamedBit& report : kReportBits) constant(report.name, report.bit);
  text += "#: Bits of Capabilities.features.\n";
  for (const NamedBit& feature : kFeatureBits) constant(feature.name, feature.bit);
  text += "#: Bits of HandState.flags.\n";
  constant("HAND_HAS_GRIPPER", kHandHasGripper);
  constant("HAND_ENERGY_SPENT", kHandEnergySpent);
  constant("HAND_CORRECTIONS_HELD", kHandCorrectionsHeld);
  text += "#: Names, sentences and remedies of the trips, by bit.\n";
  text += "TRIPS: Final[Tuple[Tuple[str, str, str], ...]] = (\n";
  for (const TripInfo& trip : kTrips) {
    text += "    (" + quoted(trip.name) + ", " + quoted(trip.what) + ", " + quoted(trip.remedy) + "),\n";
  }
  return text + ")\n";
}

}  // namespace hapticd::wire

#include <cctype>

#include "wire/describe.h"
#include "wire/fields.h"
#include "wire/named_bits.h"

namespace hapticd::wire {

namespace {

constexpr std::string_view kIntroduction =
    R"(// Written by `wire_docs typescript` from the table in src/wire/messages.h; do not edit. Every message of the wire:
// its fields (named as in docs/wire-messages.md, in camel case) and their layout.
import { define } from "./codec";

export type Vec3 = [number, number, number];
export type Vec4 = [number, number, number, number];

)";

// The name of a field as TypeScript writes names: guard_active is guardActive.
std::string camelCase(std::string_view name) {
  std::string text;
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (name[i] == '_' && i + 1 < name.size()) {
      text += static_cast<char>(std::toupper(static_cast<unsigned char>(name[++i])));
    } else {
      text += name[i];
    }
  }
  return text;
}

std::string numberType(const Numbers& values) {
  if (values.count == 3) return "Vec3";
  if (values.count == 4) return "Vec4";
  return "ArrayLike<number>";
}

// The members of the interface and the rows of the layout, field by field.
class FieldPrinter final : public FieldVisitor {
 public:
  void number(const Field& field, const Numbers& one) override {
    add(field, "number", quoted(nameOf(one.type)));
  }
  void array(const Field& field, const Numbers& values) override {
    add(field, numberType(values), quoted(nameOf(values.type)) + ", " + std::to_string(values.count));
  }
  void name(const Field& field, std::span<char> bytes) override {
    add(field, "string", "\"name\", " + std::to_string(bytes.size()));
  }
  void text(const Field& field, std::size_t bytes, std::string&) override {
    add(field, "string", "\"text\", " + std::to_string(bytes));
  }
  void list(const Field& field, const NumberList& list) override {
    add(field, "ArrayLike<number>",
        "\"list\", " + quoted(nameOf(list.countType)) + ", " + quoted(nameOf(list.type)) + ", " +
            std::to_string(list.most));
  }

  std::string members;
  std::string rows;

 private:
  static std::string quoted(std::string_view text) { return '"' + std::string(text) + '"'; }
  void add(const Field& field, const std::string& type, const std::string& layout) {
    if (!field.unit.empty()) members += "  /** " + std::string(field.unit) + " */\n";
    const std::string name = camelCase(field.name);
    members += "  " + name + ": " + type + ";\n";
    rows += "  [" + quoted(name) + ", " + layout + "],\n";
  }
};

}  // namespace

std::string messagesAsTypeScript() {
  std::string text(kIntroduction);
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    Message message{MessageKind{static_cast<std::uint8_t>(i)}};
    const MessageInfo& about = info(message.kind());
    const std::string name(structName(message.kind()));
    FieldPrinter fields;
    visitFields(message, fields);
    const bool empty = fields.rows.empty();
    text += "/** " + std::string(about.meaning) + " */\n";
    text += empty ? "export type " + name + " = Record<string, never>;\n"
                  : "export interface " + name + " {\n" + fields.members + "}\n";
    text += "export const " + name + " = /* @__PURE__ */ define<" + name + ">(\"" + std::string(about.name) +
            "\", [" + (empty ? "" : "\n" + fields.rows) + "]);\n\n";
  }
  text += "/** Every message, in the order of the table. */\nexport const ALL_MESSAGES = [\n";
  for (std::size_t i = 0; i < kMessageKinds; ++i)
    text += "  " + std::string(structName(MessageKind{static_cast<std::uint8_t>(i)})) + ",\n";
  text += "] as const;\n\n";
  const auto constant = [&](std::string_view name, std::size_t value) {
    text += "export const " + std::string(name) + " = " + std::to_string(value) + ";\n";
  };
  text += "/** Vertices or triangles in one message at most. */\n";
  static_assert(MeshVertices::kMost == MeshTriangles::kMost);
  constant("MOST_IN_ONE_MESSAGE", MeshVertices::kMost);
  text += "/** Bits of Subscribe.kinds. */\n";
  for (const NamedBit& report : kReportBits) constant(report.name, report.bit);
  text += "/** Bits of Capabilities.features. */\n";
  for (const NamedBit& feature : kFeatureBits) constant(feature.name, feature.bit);
  return text;
}

}  // namespace hapticd::wire

#include "wire/describe.h"

#include "wire/cookie.h"
#include "wire/fields.h"
#include "wire/frame.h"
#include "wire/system.h"
#include "wire/text.h"

namespace hapticd::wire {

namespace {

// Notes the fields of a message with their offsets.
class FieldLister final : public FieldVisitor {
 public:
  explicit FieldLister(MessageDescription& message) : message_(message) {}

  void number(const Field& field, const Numbers& one) override {
    add(field, std::string(nameOf(one.type)), bytesOf(one.type));
  }
  void array(const Field& field, const Numbers& values) override {
    add(field, std::string(nameOf(values.type)) + '[' + std::to_string(values.count) + ']',
        bytesOf(values.type) * values.count);
  }
  void name(const Field& field, std::span<char> bytes) override { addText(field, bytes.size()); }
  void text(const Field& field, std::size_t bytes, std::string&) override { addText(field, bytes); }
  void list(const Field& field, const NumberList& list) override {
    message_.counted = true;
    add({"n", ""}, std::string(nameOf(list.countType)), bytesOf(list.countType));
    add(field, std::string(nameOf(list.type)) + "[n<=" + std::to_string(list.most) + ']', 0);
  }

 private:
  void addText(const Field& field, std::size_t bytes) {
    add(field, "char[" + std::to_string(bytes) + ']', bytes);
  }
  void add(const Field& field, std::string type, std::size_t bytes) {
    message_.fields.push_back(
        {std::string(field.name), std::move(type), std::string(field.unit), message_.payload_bytes});
    message_.payload_bytes += bytes;
  }

  MessageDescription& message_;
};

// The name is between "M = " and the next separator, as GCC and clang write it.
template <class M>
constexpr std::string_view structNameOf() {
  std::string_view text = __PRETTY_FUNCTION__;
  text.remove_prefix(text.find("M = ") + 4);
  text = text.substr(0, text.find_first_of(";]"));
  return text.substr(text.rfind(':') + 1);
}

template <class... M>
constexpr std::array<std::string_view, kMessageKinds> structNamesOf(MessageList<M...>) {
  return {structNameOf<M>()...};
}
constexpr std::array<std::string_view, kMessageKinds> kStructNames = structNamesOf(AllMessages{});
static_assert(kStructNames[static_cast<std::size_t>(kindOf<SetVertex>)] == "SetVertex");

std::string_view directionText(Direction direction) {
  switch (direction) {
    case Direction::kToServer:
      return "client to server";
    case Direction::kToClient:
      return "server to client";
    case Direction::kBoth:
      break;
  }
  return "both";
}

std::string roleText(const MessageInfo& info) {
  switch (info.role) {
    case Role::control:
      return info.order == Order::overtaking ? "control, overtakes" : "control";
    case Role::scene:
      return "scene";
    case Role::report:
      return "report";
    case Role::unknown:
      break;
  }
  return "";
}

std::string_view accessText(const MessageInfo& info) {
  if (info.role == Role::report) return "";
  if (info.access == Access::operate) return "operator";
  return info.access == Access::command ? "owner in control" : "all";
}

std::string layoutText(const MessageDescription& message) {
  std::string text;
  for (const FieldDescription& field : message.fields) {
    if (!text.empty()) text += "; ";
    text += std::to_string(field.offset) + ": " + field.type + ' ' + field.name;
    if (!field.unit.empty()) text += " (" + field.unit + ')';
  }
  return text.empty() ? "empty" : text;
}

constexpr std::string_view kIntroduction = R"(# Messages on the wire

Written by `wire_docs markdown` from the table in `src/wire/messages.h`; do not edit.

Every message travels in a frame: a header of 24 bytes, the payload, and padding to a multiple of 8.

| offset | type | field |
|---|---|---|
| 0 | u32 | length of header and payload, without padding; 24 to 64024 |
| 4 | u32 | seconds since the epoch |
| 8 | u32 | microseconds |
| 12 | i32 | sender: the number the sending side gave a device name |
| 16 | i32 | type: the number the sending side gave a message name; negative for system messages |
| 20 | u32 | sequence number, ignored |

Numbers are big endian, floats IEEE 754, and fields follow each other without alignment. Offsets below are from the
start of the payload. `low latency` messages travel by UDP once both sides have described a socket, all others, and
all before that, by TCP. A payload of another length is refused, except that bytes behind a list of n values are
ignored. `char[20]` ends at the first NUL or after 20 bytes; `char[1024]` always ends in a NUL.

A client sends *control* messages and *scene* commands; the server sends *reports*. The server handles what a client sends
in order. Control messages that *overtake* are the exception: the server handles them on arrival, before scene
commands that the same client sent earlier and that still wait. Messages for clients *in control* change what others feel; the
server refuses them from clients that may not command the device.

A TCP connection starts with 24 bytes from either side: `vrpn: ver. 07.38`, two spaces, one digit (logging asked of
the peer: 0 none, 1 what it receives, 2 what it sends, 3 both) and five NULs. Any `07.` version is accepted. Then each side
describes its numbers with these system messages, and any later ones before it uses them:

| type | meaning | sender field | payload |
|---|---|---|---|
| -1 | sender description | number, 0 to 1999 | 0: i32 length with NUL; 4: name, at most 95 characters, and NUL |
| -2 | type description | number, 0 to 1999 | the same; the name is the title of the section below, a space and the name in its table: `vrpn_ForceDevice Force`, `hapticd Tick` |
| -3 | UDP description: send datagrams here | port | dotted address and NUL |
| -4 | log description | mode, as in the cookie | 0: i32 length; 4: i32 length; 8: file names for received and sent messages, each with a NUL the lengths do not count |

Types down to -1999 are ignored when unknown; lower ones end the connection. A datagram holds whole frames, at most
1472 bytes. A client without `tcp://` asks for a reverse connection: it sends the datagram `host port` and a NUL to the server's
UDP port (3883), and the server connects to it by TCP; port 1024 to 65535, host of letters, digits and dots.

)";

}  // namespace

std::vector<MessageDescription> describeMessages() {
  std::vector<MessageDescription> all;
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    const MessageKind kind{static_cast<std::uint8_t>(i)};
    Message message(kind);
    MessageDescription& description = all.emplace_back(MessageDescription{kind, info(kind), 0, false, {}});
    FieldLister lister(description);
    visitFields(message, lister);
  }
  return all;
}

std::string_view structName(MessageKind kind) noexcept {
  return kStructNames[static_cast<std::size_t>(kind)];
}

std::string messagesAsMarkdown() {
  std::string text(kIntroduction);
  std::string device;
  for (const MessageDescription& message : describeMessages()) {
    const std::size_t space = message.info.name.find(' ');
    const std::string prefix(message.info.name.substr(0, space));
    if (prefix != device) {
      text += (device.empty() ? "## " : "\n## ") + prefix + "\n\n";
      text += "| name | direction | class | role | who | bytes | layout | meaning |\n";
      text += "|---|---|---|---|---|---|---|---|\n";
      device = prefix;
    }
    text += "| `" + std::string(message.info.name.substr(space + 1)) + "` | ";
    text += directionText(message.info.direction);
    text += message.info.reliability == Reliability::kReliable ? " | reliable | " : " | low latency | ";
    text += roleText(message.info) + " | ";
    text += accessText(message.info);
    text += " | ";
    text += std::to_string(message.payload_bytes) + (message.counted ? " + list | " : " | ");
    text += layoutText(message) + " | " + std::string(message.info.meaning) + " |\n";
  }
  return text;
}

std::string messagesAsFuzzDictionary() {
  std::string text = "# Written by `wire_docs dictionary` from the table in src/wire/messages.h.\n";
  text += "cookie=" + inQuotes(asText(encodeCookie(0))) + '\n';
  const auto number = [](std::int32_t value) {
    std::array<std::byte, sizeof(value)> bytes{};
    storeBig(bytes.data(), value);
    return inQuotes(asText(bytes)) + '\n';
  };
  for (const std::int32_t type : {kSenderDescription, kTypeDescription, kUdpDescription, kLogDescription}) {
    text += "system" + std::to_string(-type) + '=' + number(type);
  }
  for (const MessageDescription& message : describeMessages()) {
    const std::string index = std::to_string(static_cast<int>(message.kind));
    text += "name" + index + '=' + inQuotes(message.info.name) + '\n';
    text += "length" + index + '=' + number(static_cast<std::int32_t>(kHeaderBytes + message.payload_bytes));
  }
  return text;
}

}  // namespace hapticd::wire

// The table of messages as data, for everything that is derived from it: documents, fuzz dictionaries, other
// languages.
#pragma once

#include <string>
#include <vector>

#include "wire/messages.h"

namespace hapticd::wire {

/// One field of a payload.
struct FieldDescription {
  std::string name;
  std::string type;        ///< such as i32, f64[3], char[20], f32[n<=128]
  std::string unit;        ///< empty when it has none
  std::size_t offset = 0;  ///< bytes from the start of the payload
};

/// One message of the table.
struct MessageDescription {
  MessageKind kind;
  MessageInfo info;
  std::size_t payload_bytes = 0;  ///< with an empty list, when counted
  bool counted = false;           ///< ends in a list, so longer payloads are valid
  std::vector<FieldDescription> fields;
};

/// Every message, in the order of the table.
std::vector<MessageDescription> describeMessages();

/// The name of the struct in C++, which is the name of the message in every language; the kind must not be
/// kUnknownKind.
std::string_view structName(MessageKind kind) noexcept;

/// docs/wire-messages.md.
std::string messagesAsMarkdown();

/// web/src/wire/messages.ts.
std::string messagesAsTypeScript();

/// python/hapticd/_messages.py.
std::string messagesAsPython();

/// A libFuzzer dictionary: every wire name and every frame length of the table.
std::string messagesAsFuzzDictionary();

}  // namespace hapticd::wire

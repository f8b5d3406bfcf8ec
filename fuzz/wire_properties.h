// Properties of any input: the fuzzers search for bytes that violate them, the tests check the recorded
// bytes. All of them abort on a violation.
#pragma once

#include "wire/bytes.h"
#include "wire/message.h"

namespace hapticd::wire {

/// Decodes bytes as this kind of message; a decoded message must survive encoding and decoding.
void checkPayload(MessageKind kind, ByteView payload);

/// Splits bytes into frames, and decodes the payload of each as the kind that its type selects.
void checkFrames(ByteView bytes);

/// Decodes bytes as cookie and as each system message.
void checkSystemPayloads(ByteView bytes);

/// Decodes bytes as the request for a reverse connection.
void checkRequest(ByteView bytes);

/// All of the above, as every kind of message: slow.
void checkCodec(ByteView bytes);

/// Feeds bytes to peers, whole and in pieces: the events and the answers must be equal, and another peer must
/// accept the answers.
void checkEndpoint(ByteView bytes);

}  // namespace hapticd::wire

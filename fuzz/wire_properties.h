// Properties of any input: the fuzzers search for bytes that violate them, the tests check the recorded
// bytes.
#pragma once

#include "wire/bytes.h"

namespace hapticd::wire {

/// Decodes bytes as every kind of message; a decoded message must survive encoding and decoding. Aborts
/// otherwise.
void checkCodec(ByteView bytes);

/// Feeds bytes to peers, whole and in pieces: the events and the answers must be equal, and another peer must
/// accept the answers. Aborts otherwise.
void checkEndpoint(ByteView bytes);

}  // namespace hapticd::wire

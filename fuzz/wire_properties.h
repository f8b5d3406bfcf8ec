// What must hold for any bytes at all; the fuzzers search for bytes that break it, the tests check the
// recorded ones.
#pragma once

#include "wire/bytes.h"

namespace hapticd::wire {

/// Decodes bytes as everything they could be; what decodes must survive being encoded and decoded again.
/// Aborts otherwise.
void checkCodec(ByteView bytes);

/// Feeds bytes to endpoints, whole and in pieces; both must see the same and answer the same, and what they
/// send must be acceptable to another endpoint. Aborts otherwise.
void checkEndpoint(ByteView bytes);

}  // namespace hapticd::wire

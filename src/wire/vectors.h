// Test vectors of the wire: every message several times as field values, payload and whole frame. Each
// implementation decodes and encodes all of them, see testdata/wire/README.md.
#pragma once

#include <string>

namespace hapticd::wire {

/// testdata/wire/vectors.json.
std::string vectorsAsJson();

}  // namespace hapticd::wire

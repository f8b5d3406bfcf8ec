// The checksum of zlib, PNG and MCAP.
#pragma once

#include <cstdint>

#include "wire/bytes.h"

namespace hapticd::record {

/// CRC-32 (IEEE 802.3) of `bytes`, behind others whose CRC-32 is `before`.
std::uint32_t crc32(wire::ByteView bytes, std::uint32_t before = 0);

}  // namespace hapticd::record

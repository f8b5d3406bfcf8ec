// The checksum of blocks, here and in MCAP: CRC-32 as of zlib and IEEE 802.3.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace hapticd::record {

/// Of these bytes; pass the sum of what came before to go on with it.
std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t before = 0) noexcept;

}  // namespace hapticd::record

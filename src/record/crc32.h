// The checksum of zlib, PNG and MCAP.
#pragma once

#include <boost/crc.hpp>

#include "wire/bytes.h"

namespace hapticd::record {

/// CRC-32 (IEEE 802.3) of all parts, one behind the other.
template <class... Parts>
std::uint32_t crc32(const Parts&... parts) {
  boost::crc_32_type crc;
  const auto add = [&crc](wire::ByteView part) { crc.process_bytes(part.data(), part.size()); };
  (add(parts), ...);
  return crc.checksum();
}

}  // namespace hapticd::record

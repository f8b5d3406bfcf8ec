#include "record/crc32.h"

#include <zlib.h>

namespace hapticd::record {

std::uint32_t crc32(wire::ByteView bytes, std::uint32_t before) {
  // zlib answers a null pointer with the value to begin with.
  if (bytes.empty()) return before;
  return static_cast<std::uint32_t>(
      ::crc32_z(before, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

}  // namespace hapticd::record

// Untrusted payloads, frames, cookies, descriptions and connection requests.
#include <cstdint>

#include "fuzz/wire_properties.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  hapticd::wire::checkCodec(std::as_bytes(std::span(data, size)));
  return 0;
}

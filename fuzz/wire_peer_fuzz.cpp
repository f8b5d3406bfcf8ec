// A whole connection with an untrusted peer: TCP stream and datagrams.
#include <cstdint>

#include "fuzz/wire_properties.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  hapticd::wire::checkEndpoint(std::as_bytes(std::span(data, size)));
  return 0;
}

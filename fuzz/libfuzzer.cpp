// The entry of libFuzzer, compiled once for each target.
#include "fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  hapticd::fuzz::HAPTICD_FUZZ_TARGET(std::as_bytes(std::span(data, size)));
  return 0;
}

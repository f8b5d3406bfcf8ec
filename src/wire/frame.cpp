#include "wire/frame.h"

namespace hapticd::wire {

std::string invalidFrame(ByteView bytes) {
  return "frame length " + std::to_string(loadBig<std::uint32_t>(bytes.data())) + " is outside " +
         std::to_string(kHeaderBytes) + " to " + std::to_string(kHeaderBytes + kMaxPayloadBytes);
}

}  // namespace hapticd::wire

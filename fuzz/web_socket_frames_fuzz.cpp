// What a stranger sends as a WebSocket: however it is cut, it reads the same, and nothing grows beyond what
// came.
#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "net/web_socket_frames.h"

namespace {

using namespace hapticd::net;

WebSocketInput read(std::span<const std::byte> bytes, std::size_t piece) {
  WebSocketReader reader;
  WebSocketInput in;
  while (!bytes.empty()) {
    const std::size_t size = std::min(piece, bytes.size());
    reader.feed(bytes.first(size), in);
    bytes = bytes.subspan(size);
  }
  return in;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  const WebSocketInput whole = read(bytes, size + 1);
  const WebSocketInput cut = read(bytes, size > 0 ? 1 + data[0] % 7U : 1);
  const bool same =
      whole.data == cut.data && whole.pings == cut.pings && whole.end.has_value() == cut.end.has_value();
  if (!same || whole.data.size() > size) std::abort();
  if (whole.end && (whole.end->code != cut.end->code || whole.end->text != cut.end->text)) std::abort();
  return 0;
}

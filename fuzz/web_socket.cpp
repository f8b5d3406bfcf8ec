// What a stranger sends as a WebSocket: however it is cut, it reads the same, and nothing grows beyond what
// came.
#include <algorithm>

#include "fuzz/targets.h"
#include "net/web_socket_frames.h"

namespace hapticd::fuzz {
namespace {

using net::WebSocketInput;
using net::WebSocketReader;

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

void web_socket(Input input) {
  const WebSocketInput whole = read(input, input.size() + 1);
  const WebSocketInput cut = read(input, 1 + selector(input) % 7U);
  require(whole.data == cut.data && whole.pings == cut.pings, "cuts do not change what is read");
  require(whole.end.has_value() == cut.end.has_value(), "cuts do not change the end");
  if (whole.end)
    require(whole.end->code == cut.end->code && whole.end->text == cut.end->text, "nor its reason");
  require(whole.data.size() <= input.size(), "nothing grows beyond what came");
}

}  // namespace hapticd::fuzz

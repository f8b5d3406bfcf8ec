#include "fuzz/targets.h"
#include "fuzz/wire_properties.h"
#include "wire/message.h"
#include "wire/udp_request.h"

namespace hapticd::fuzz {

// The first byte is the kind, the second whether the payload is cut or padded to the size of that kind,
// which few mutations keep.
void wire_message(Input input) {
  if (input.size() < 2) return;
  const wire::MessageKind kind{static_cast<std::uint8_t>(selector(input) % wire::kMessageKinds)};
  const bool fits = (static_cast<unsigned>(input[1]) & 1U) != 0;
  input = input.subspan(2);
  if (!fits) return wire::checkPayload(kind, input);
  std::array<std::byte, 4096> payload{};
  const std::size_t size = std::min(payload.size(), wire::payloadSize(wire::Message(kind)));
  std::copy_n(input.begin(), std::min(size, input.size()), payload.begin());
  wire::checkPayload(kind, std::span(payload).first(size));
}

void wire_frames(Input input) {
  wire::checkFrames(input);
  wire::checkSystemPayloads(input);
}

void wire_peer(Input input) {
  wire::checkEndpoint(input);
}

void udp_request(Input input) {
  wire::checkRequest(input);
}

}  // namespace hapticd::fuzz

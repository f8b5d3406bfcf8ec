#include "record/scene_event_codec.h"

namespace hapticd::record {
namespace {

constexpr std::uint16_t kClientGone = 0;

// False when no command has this number.
bool takeCommand(std::uint16_t number, Unpacker& in, scene::SceneCommand& command) {
  bool known = false;
  scene::forEachCommand([&]<class C>() {
    if (commandNumber<C>() != number) return;
    known = true;
    in.take(command.emplace<C>());
  });
  return known;
}

}  // namespace

void packSceneEvent(Bytes& out, std::uint32_t scene, scene::ClientId client, Nanos time,
                    const scene::SceneCommand* command) {
  Packer pack(out);
  pack.put(scene);
  pack.put(client);
  pack.put(time);
  if (command == nullptr) {
    pack.put(kClientGone);
    return;
  }
  std::visit(
      [&]<class C>(const C& c) {
        pack.put(commandNumber<C>());
        pack.put(c);
      },
      *command);
}

bool unpackSceneEvent(ByteView bytes, SceneEvent& event, std::string& error) {
  Unpacker in(bytes);
  event = SceneEvent();
  in.take(event.scene);
  in.take(event.client);
  in.take(event.time);
  const auto number = in.next<std::uint16_t>();
  if (in.ok() && number != kClientGone && !takeCommand(number, in, event.command.emplace())) {
    error =
        "unknown scene command number " + std::to_string(number) + "; use the hapticd that wrote the file";
    return false;
  }
  if (in.ok() && in.rest().empty()) return true;
  error = in.ok() ? "a scene event is longer than its content" : "a scene event is truncated";
  return false;
}

const char* nameOf(const scene::SceneCommand& command) {
  return std::visit([]<class C>(const C&) { return C::kInfo.name; }, command);
}

}  // namespace hapticd::record

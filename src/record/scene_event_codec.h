// Scene events as bytes: the number of the command, then its members.
#pragma once

#include "record/archive.h"
#include "record/recording.h"

namespace hapticd::record {

/// The number of a command in files: its position in SceneCommand, from 1. 0 is not a command: the client
/// left.
template <class C>
consteval std::uint16_t commandNumber() {
  std::uint16_t number = 0;
  std::uint16_t next = 1;
  scene::forEachCommand([&]<class Other>() {
    if (std::is_same_v<C, Other>) number = next;
    ++next;
  });
  return number;
}

/// Appends a command of a client; null: the client left.
void packSceneEvent(Bytes& out, std::uint32_t scene, scene::ClientId client, Nanos time,
                    const scene::SceneCommand* command);

/// False, with the reason in `error`, when the bytes are not one whole event.
bool unpackSceneEvent(ByteView bytes, SceneEvent& event, std::string& error);

/// The name of a command as in scene/commands.h.
const char* nameOf(const scene::SceneCommand& command);

}  // namespace hapticd::record

// Scene events to bytes and back.
#pragma once

#include "record/archive.h"
#include "record/recording.h"

namespace hapticd::record {

/// Appends what a client told the scene; null: it was gone.
void packSceneEvent(Bytes& out, std::uint32_t scene, scene::ClientId client, Nanos time,
                    const scene::SceneCommand* command);

/// False when the bytes are no whole event; the text then says why.
bool unpackSceneEvent(ByteView bytes, SceneEvent& event, std::string& error);

/// The name of a command, as in scene/commands.h.
const char* nameOf(const scene::SceneCommand& command);

}  // namespace hapticd::record

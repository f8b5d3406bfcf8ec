// Scene thread to servo: the newest snapshot of the scene.
#pragma once

#include "handoff/exchange_slot.h"
#include "scene/snapshot.h"

namespace hapticd::scene {

/// One for each servo. The scene thread publishes and frees; the servo takes once at the start of a tick and
/// may use the snapshot of the tick before until the end of this one.
using SnapshotSlot = handoff::ExchangeSlot<SceneSnapshot>;

}  // namespace hapticd::scene

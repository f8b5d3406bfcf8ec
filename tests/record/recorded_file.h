// A recording of a real server with real clients: two hands, moving and deforming objects, effects, a stop, a
// batch, and clients that leave.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "record/recording_file.h"
#include "record/recording_reader.h"
#include "server/feeling.h"
#include "server/hands.h"
#include "server/running_server.h"
#include "server/scripted_peer.h"

namespace hapticd::test {

/// All events of a file.
inline std::vector<record::RecordingEvent> eventsOf(const std::filesystem::path& file) {
  record::RecordingReader reader(file);
  std::vector<record::RecordingEvent> events;
  for (record::RecordingEvent event; reader.next(event);) events.push_back(std::move(event));
  return events;
}

/// Moves and deforms the cube below the stroking hand, frame by frame as a client does.
inline void animate(ScriptedPeer& peer, int frames) {
  for (int i = 0; i < frames; ++i) {
    const double turn = 0.1 * std::sin(0.3 * i);
    peer.send(wire::SetTransformMatrix{0,
                                       {std::cos(turn), std::sin(turn), 0, 0, -std::sin(turn), std::cos(turn),
                                        0, 0, 0, 0, 1, 0, 0, 2 * turn, 0, 1}});
    const float top = 20 + 2 * std::sin(0.5F * static_cast<float>(i));
    sendVertices(peer, 0, boxTriples({20, top, 20}));
    untilTicks(peer, 8);
  }
}

/// Two devices that share a scene; the second has a spherical tool, the first strokes by itself.
inline server::ServerConfig recordingConfig(const Hand& hand, const std::filesystem::path& file) {
  server::ServerConfig config = hand.config();
  config.record = file.string();
  config.devices[0].scene = "shared";
  server::DeviceConfig other = config.devices[0];
  other.names = {"Second"};
  other.hand = "script";
  other.toolRadius_m = 0.002;
  config.devices.push_back(other);
  return config;
}

/// Leads the hand from above into the cube. A stall of the machine can make the first contact too deep to be
/// felt: then again.
inline bool pressFromAbove(ScriptedPeer& peer) {
  for (int attempt = 0; attempt < 5; ++attempt) {
    for (double height = 30; height >= 18; height -= 1) {
      peer.send(wire::HoldHand{.hold = 1, .position = {5, height, 5}});
      untilTicks(peer, 5);
    }
    untilTicks(peer, 50);
    const auto touched = peer.last<wire::TouchedObject>();
    if (touched && touched->object == 0) return true;
  }
  return false;
}

/// Plays everything; false when an expected contact or report did not occur.
inline bool playSession(RunningServer& server) {
  ScriptedPeer peer(server.address());
  ScriptedPeer second(server.address(), "Second");
  const auto owner = std::make_unique<ScriptedPeer>(server.address());
  if (!peer.untilConnected() || !second.untilConnected() || !owner->untilConnected()) return false;

  sendCube(peer);
  peer.send(wire::SetHapticProperty{0, "static friction", 0.4F});
  peer.send(wire::SetHapticProperty{0, "dynamic friction", 0.3F});
  if (!untilTouchedAt(peer, 0, kCubeTop_m)) return false;
  animate(peer, 30);

  owner->send(wire::Effect{"vibrationMotor", 3, 0, 0.4, 0, 300, {}, {1, 0, 0}});
  owner->send(wire::StartEffect{3});
  owner->send(wire::ForceField{.origin = {0, 0, 0}, .force = {0.3F, 0.2F, 0}, .jacobian = {}, .radius = 10});
  if (!untilTicks(peer, 100)) return false;
  owner->close();  // its forces ramp out

  peer.send(wire::StopForces{});
  if (!peer.untilNext<wire::GuardState>() || !untilTicks(peer, 50)) return false;
  peer.send(wire::RearmForces{});
  if (!peer.untilNext<wire::GuardState>()) return false;

  // The other hand is held, and then led by a stream of poses.
  if (!pressFromAbove(second)) return false;
  for (int i = 0; i < 60; ++i) {
    const double turn = 0.1 * i;
    second.send(wire::HoldHand{.hold = 1, .position = {8 * std::cos(turn), 18, 8 * std::sin(turn)}});
    untilTicks(second, 5);
  }
  // A client streams a sphere that moves, and a force.
  for (int i = 0; i < 40; ++i) {
    const double angle = 0.05 * i;
    wire::RemoteContacts contacts{.time = 1'000'000LL * i + 1, .stateTime = 0, .contacts = {}};
    contacts.contacts.values = {
        3,   1, 0.02, 0,   0.014, 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1, 0.01, 0, 0, 0, 0, 0.5,
        400, 1, 0.3,  0.2, 0.1,   0};
    second.send(contacts);
    second.send(
        wire::HeldForce{.time = 1'000'000LL * i + 1, .force = {0, 0, 0.2}, .torque = {}, .lifetime = 0.1});
    untilTicks(second, 5);
  }
  second.send(wire::HoldHand{.hold = 0, .position = {}});

  peer.send(wire::BatchBegin{});
  peer.send(wire::AddObject{7, -1});
  sendBox(peer, 7, {10, 10, 10}, {0, 14, 0});
  peer.send(wire::SetSceneOrigin{{0, 0.001F, 0}, {0, 0, 1}, 0.1F});
  peer.send(wire::BatchCommit{});
  animate(peer, 10);
  peer.send(wire::ResetScene{});
  return untilApplied(peer) && untilTicks(peer, 100);
}

}  // namespace hapticd::test

// The parts of a station, for station.cpp (lifetime and reports) and station_messages.cpp (what clients say).
#pragma once

#include <set>

#include "base/clock.h"
#include "device/simulated/steered_hand.h"
#include "realtime/servo/tick.h"
#include "server/station/black_box_recorder.h"
#include "server/station/button_modes.h"
#include "server/station/device_control.h"
#include "server/station/device_keeper.h"
#include "server/scene/scene_host.h"
#include "server/station/station.h"

namespace hapticd::server {

/// Where a control message comes from.
struct Request {
  Session& session;
  wire::LocalSender name;  ///< the name under which the client addresses the device
  DeviceControl::Order order;
};

struct Station::Impl {
  Impl(const DeviceConfig& config_, std::vector<wire::LocalSender> names_, SceneHost& scene_,
       std::unique_ptr<device::Device> device_, bool allowNoRealtime);

  void recordTo(record::Recorder& session, SceneDevice& seat);
  void onPublished(const scene::SceneSnapshot& snapshot);
  void choose(Session& session, wire::LocalSender name, ReportChoice choice, double rate_Hz,
              std::string_view call);

  // One for each control message; a refusal is a text to the client.
  void on(const Request& request, const wire::Ping&);
  void on(const Request& request, const wire::Text& text);
  void on(const Request& request, const wire::TrackerRequestToRoom&);
  void on(const Request& request, const wire::TrackerRequestUnitToSensor&);
  void on(const Request& request, const wire::TrackerRequestWorkspace&);
  void on(const Request& request, const wire::TrackerSetUpdateRate& wanted);
  void on(const Request& request, const wire::TrackerResetOrigin&);
  void on(const Request& request, const wire::ButtonAdmin& admin);
  void on(const Request& request, const wire::QueryCapabilities&);
  void on(const Request& request, const wire::Subscribe& wanted);
  void on(const Request& request, const wire::StopForces&);
  void on(const Request& request, const wire::RearmForces&);
  void on(const Request& request, const wire::HoldHand& wanted);
  void on(const Request&, const wire::GetNewObjectId&) {}  // registered by VRPN, never sent
  void on(const Request&, const wire::Heartbeat&) {}           // the session handles it
  void rearm(Session& session, wire::LocalSender name, const DeviceControl::Order& order);

  const DeviceConfig config;
  const std::vector<wire::LocalSender> names;
  SceneHost& scene;
  base::MonotonicClock clock;
  std::unique_ptr<device::Device> device;
  device::SteeredHand* const hand;      // null for devices that a person moves
  const device::DeviceProfile profile;  // as when it was first opened
  realtime::Tick tick;
  DeviceKeeper keeper;
  bool running = false;
  bool played = false;  // reports come from a recording, the servo rests

  // The net thread's.
  DeviceControl control;
  Roles roles;
  ButtonModes modes;
  std::vector<wire::ButtonAlert> alerts;  // not yet told
  ReportFrame frame;
  Outbox outbox;
  BlackBoxRecorder recorder;
  std::uint64_t droppedReports = 0;
  std::string fault;  // as last told
  std::set<Session*> rearming;  // sent a re-arm that may wait for the scene

  // The scene thread's: what the scripted hand was planned for.
  std::vector<std::pair<std::int32_t, std::uint64_t>> explored{{-1, 0}};
};

}  // namespace hapticd::server

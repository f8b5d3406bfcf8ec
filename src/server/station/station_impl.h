// The parts of a station, for station.cpp (lifetime and reports) and station_messages.cpp (what clients say).
#pragma once

#include "base/clock.h"
#include "device/simulated/simulated_device.h"
#include "realtime/servo/tick.h"
#include "server/station/black_box_recorder.h"
#include "server/station/button_modes.h"
#include "server/station/device_control.h"
#include "server/station/device_keeper.h"
#include "server/scene/scene_host.h"
#include "server/station/station.h"

namespace hapticd::server {

struct Station::Impl {
  Impl(const DeviceConfig& config_, std::vector<wire::LocalSender> names_, SceneHost& scene_,
       std::unique_ptr<device::Device> device_, bool allowNoRealtime);

  void recordTo(record::Recorder& session, SceneDevice& seat);
  void onPublished(const scene::SceneSnapshot& snapshot);
  void choose(Session& session, wire::LocalSender name, ReportChoice choice, double rate_Hz,
              std::string_view call);

  // One message each; text for what is refused.
  void on(Session& session, wire::LocalSender name, const wire::Ping&);
  void on(Session& session, wire::LocalSender name, const wire::Text& text);
  void on(Session& session, wire::LocalSender name, const wire::TrackerRequestToRoom&);
  void on(Session& session, wire::LocalSender name, const wire::TrackerRequestUnitToSensor&);
  void on(Session& session, wire::LocalSender name, const wire::TrackerRequestWorkspace&);
  void on(Session& session, wire::LocalSender name, const wire::TrackerSetUpdateRate& wanted);
  void on(Session& session, wire::LocalSender name, const wire::TrackerResetOrigin&);
  void on(Session& session, wire::LocalSender name, const wire::ButtonAdmin& admin);
  void on(Session& session, wire::LocalSender name, const wire::QueryCapabilities&);
  void on(Session& session, wire::LocalSender name, const wire::Subscribe& wanted);
  void on(Session& session, wire::LocalSender name, const wire::StopForces&);
  void on(Session& session, wire::LocalSender name, const wire::RearmForces&);
  void on(Session& session, wire::LocalSender name, const wire::HoldHand& wanted);
  void on(Session&, wire::LocalSender, const wire::Heartbeat&) {}       // the server's
  void on(Session&, wire::LocalSender, const wire::GetNewObjectId&) {}  // registered by VRPN, never sent

  const DeviceConfig config;
  const std::vector<wire::LocalSender> names;
  SceneHost& scene;
  base::MonotonicClock clock;
  std::unique_ptr<device::Device> device;
  device::SimulatedDevice* simulated;  // null for other drivers
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

  // The scene thread's: what the scripted hand was planned for.
  std::vector<std::pair<std::int32_t, std::uint64_t>> explored{{-1, 0}};
};

}  // namespace hapticd::server

// Members of a station, for station.cpp (lifetime and reports) and station_messages.cpp (control messages).
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "base/world.h"
#include "device/simulated/steered_hand.h"
#include "handoff/latest_value.h"
#include "realtime/servo/tick.h"
#include "server/reports/fresh_ticks.h"
#include "server/reports/moving_objects.h"
#include "server/scene/scene_host.h"
#include "server/station/black_box_recorder.h"
#include "server/station/button_modes.h"
#include "server/station/device_control.h"
#include "server/station/device_keeper.h"
#include "server/station/explorer.h"
#include "server/station/station.h"
#include "server/station/streamed_input.h"

namespace hapticd::server {

/// The origin of a control message.
struct Request {
  Session& session;
  wire::LocalSender name;  ///< the name under which the client addresses the device
  DeviceControl::Order order;
  DeviceControl::Sender sender;
};

struct Station::Impl {
  Impl(const DeviceConfig& config_, std::vector<DeviceName> names_, SceneHost& scene_,
       std::unique_ptr<device::Device> device_, bool allowNoRealtime);

  void onPublished(const std::shared_ptr<const scene::SceneSnapshot>& snapshot);
  void showEdits() noexcept;
  bool takeTicks(const WallClock& wallClock);
  bool tellOfStop(const WallClock& wallClock);
  void serveFirst(const Sessions& clients);
  /// The rate that a client gets; none, with a text to it, when it asks for one that is no rate.
  std::optional<double> chosenRate(const Request& request, double wanted_Hz, double present_Hz,
                                   std::string_view call);

  // Handlers of control messages; a refusal is sent as a text.
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
  void hold(Session& session, wire::LocalSender name, const wire::HoldHand& wanted);
  void on(const Request& request, const wire::RemoteContacts& message) { onStreamed(request, message); }
  void on(const Request& request, const wire::HeldForce& message) { onStreamed(request, message); }
  template <class M>
  void onStreamed(const Request& request, const M& message);
  void on(const Request&, const wire::GetNewObjectId&) {}    // registered by VRPN, never sent
  void on(const Request&, const wire::Heartbeat&) {}         // the session handles it
  void on(const Request&, const wire::Identify&) {}          // the server handles it
  void on(const Request&, const wire::Marker&) {}            // the server handles it
  void on(const Request&, const wire::ReplayControl&) {}     // the server handles it
  void on(const Request&, const wire::RecordingControl&) {}  // the server handles it
  void on(const Request& request, const wire::ReleaseControl&);
  /// Calls in the net thread once what the client commanded so far is applied; never after it has gone.
  void whenApplied(Session& session, std::function<void(Session&)> call);
  realtime::TickReport lastTickNow();
  std::optional<wire::Text> dropRearms(Session& session);
  void rearm(Session& session, wire::LocalSender name, const DeviceControl::Order& order,
             const DeviceControl::Sender& sender);

  const DeviceConfig config;
  const std::vector<DeviceName> names;
  SceneHost& scene;
  base::Clock& clock = base::world().clock;
  std::unique_ptr<device::Device> device;
  device::SteeredHand* const hand;      // null for real devices
  const device::DeviceProfile profile;  // as after the first open()
  const bool canHurt;                   // somebody
  realtime::Tick tick;
  DeviceKeeper keeper;
  bool running = false;
  scene::SceneConfig recordedScene;  // as recordings have them
  realtime::TickOptions recordedOptions;
  bool replayed = false;  // reports come from a recording; no servo runs

  // Net thread.
  DeviceControl control;
  StreamedInput streamed;
  std::shared_ptr<Roles> roles;  // of the scene
  ButtonModes modes;
  std::vector<wire::ButtonAlert> alerts;  // not yet reported
  MovingObjects moving;
  ReportFrame frame{.moving = &moving};
  Outbox outbox;
  FreshTicks freshTicks{config.servoRate_Hz};
  bool clientsBehind = false;               // after the last pass
  std::optional<scene::ClientId> passUpTo;  // the last client that the present pass has served
  BlackBoxRecorder recorder;
  std::uint64_t droppedReports = 0;
  std::string fault;  // as last reported
  // Connections whose re-arm waits for the scene, by the number of the re-arm.
  std::map<std::uint64_t, Session*> pendingRearms;
  std::uint64_t rearms = 0;
  // What waits until the scene has applied the commands that the same connection sent before, by client and
  // number.
  struct Waiting {
    Session* session = nullptr;
    std::function<void(Session&)> call;
  };
  std::map<std::pair<scene::ClientId, std::uint64_t>, Waiting> waiting;
  std::uint64_t waits = 0;
  bool asking = false;  // whether the client's commands are applied: a call now answers what is being read
  // Connections that held the hand or let go of it, and the number of the last such order that was carried
  // out: earlier ones that waited longer for the scene are overtaken.
  struct Holding {
    Session* session = nullptr;
    std::uint64_t last = 0;
  };
  std::map<scene::ClientId, Holding> holding;
  std::uint64_t holds = 0;
  struct Placement {
    geometry::Affine T_world_device = scene::Workspace{}.T_world_device;
  };
  handoff::LatestValue<Placement> placement;  // of the newest snapshot; the scene thread writes it

  // The recording at hand, null for none, and the number of this device in it. Scene thread.
  record::Recorder* recording = nullptr;
  std::uint32_t recordedAs = 0;
  // Of a recording that began at this time, until the scene shows all edits up to it; null: it does.
  const scene::SceneBuilder* unshown = nullptr;
  base::Nanos begunAt = 0;

  // Scene thread: object ids and topologies for which the scripted hand was planned.
  std::vector<std::pair<std::int32_t, std::uint64_t>> plannedFor{{-1, 0}};
  std::optional<Explorer> explorer;  // last: its thread steers the hand
};

}  // namespace hapticd::server

// A station: one haptic device with its servo, its names and its reports.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "record/recorder.h"
#include "server/config/config.h"
#include "server/reports/outbox.h"
#include "server/scene/scene_thread.h"
#include "server/session/roles.h"
#include "server/session/session.h"
#include "server/station/device_status.h"

namespace hapticd::server {

class SceneHost;

/// Connects one device and its servo to the net thread: reports out, control in. Net thread.
class Station {
 public:
  /// Opens the device and adds it to the scene. Throws ConfigError or std::runtime_error with a remedy.
  /// `recorder` may be null; else it records from the first tick and must outlive the station.
  Station(const DeviceConfig& config, std::vector<wire::LocalSender> names, SceneHost& scene,
          bool allowNoRealtime, record::Recorder* recorder = nullptr);
  /// A station without hardware and servo, for the reports of a recorded device; no client may command it.
  Station(const DeviceConfig& config, std::vector<wire::LocalSender> names, SceneHost& scene,
          const record::RecordedDevice& recorded);
  ~Station();

  /// Starts the servo. Throws std::runtime_error when realtime scheduling is required and refused.
  void start();
  /// Stops the force, ends the loop and closes the device. Idempotent.
  void stop();

  /// Any thread: stops the forces until a re-arm.
  void stopForces() noexcept;
  /// Any thread: the servo has written zero since stopForces(), or has not run.
  bool isStoppedAtZero() const noexcept;

  /// Reopens a lost device; logs changes of its fault and returns the text for the clients. Call several
  /// times per second.
  std::optional<wire::Text> checkHealth();
  /// Writes a frozen black box to a file. Call several times per second.
  void checkBlackBox();

  SceneHost& scene() noexcept;
  bool has(wire::LocalSender name) const noexcept;
  /// The device name that this client subscribed to; by default the first one.
  wire::LocalSender nameFor(const Session& session) const noexcept;

  /// Whether the client may command; if not, `reason` is set.
  bool mayCommand(const Session& session, std::string& reason);
  /// Handles a control message. `received`: when the server read it, on the servo clock.
  void onControl(Session& session, const wire::MessageReceived& message, base::Nanos received);
  /// The scene of this device was reset.
  void onReset();
  /// The client subscribed to this name.
  void onSubscribed(Session& session, wire::LocalSender name);
  void clientGone(scene::ClientId client);

  /// State of the device and its loop; the caller fills in `scene`.
  DeviceStatus status() const;
  /// The report rate that the client chose.
  double rateOf(const Session& session) const;
  /// Whether the client may command, without giving it control.
  bool couldCommand(const Session& session) const;

  /// Reports a tick of a recorded device. From one thread only.
  void play(const realtime::TickReport& report) noexcept;

  /// Descriptor that is readable when reports wait.
  int wakeFd() const noexcept;
  /// Encodes the pending ticks, once for all clients with the same subscription, and calls onTick() after
  /// each tick with reports so that they are sent in order. Returns false when there were none.
  bool collectReports(const WallClock& clock, const std::function<void()>& onTick);
  /// Queues the reports of the last collected tick for this client.
  void sendReports(Session& session);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd::server

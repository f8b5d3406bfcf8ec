// A station: one haptic device with its servo, its names, and what clients hear of it.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "record/recorder.h"
#include "server/config/config.h"
#include "server/reports/outbox.h"
#include "server/session/roles.h"
#include "server/scene/scene_thread.h"
#include "server/session/session.h"
#include "server/station/device_status.h"

namespace hapticd::server {

class SceneHost;

/// One device between the threads: the servo's reports out, control in. Lives in the net thread.
class Station {
 public:
  /// Opens the device and joins the scene. Throws ConfigError or std::runtime_error with a remedy.
  /// `recorder`, when there is one, hears of it from the first tick on and outlives it.
  Station(const DeviceConfig& config, std::vector<wire::LocalSender> names, SceneHost& scene,
          bool allowNoRealtime, record::Recorder* recorder = nullptr);
  /// One without hardware and servo, for the reports of a recorded device; nobody may command it.
  Station(const DeviceConfig& config, std::vector<wire::LocalSender> names, SceneHost& scene,
          const record::RecordedDevice& recorded);
  ~Station();

  /// Starts the servo. Throws std::runtime_error when the loop gets no realtime rights and must have them.
  void start();
  /// Zero force, then the loop ends and the device is closed. Idempotent.
  void stop();

  /// Brings a lost device back. Logs what the driver complains of, when it changed, and gives the words for
  /// the clients. Call it some times a second.
  std::optional<wire::Text> checkHealth();
  /// Writes down what the black box has kept. Call it some times a second.
  void checkBlackBox();

  SceneHost& scene() noexcept;
  bool has(wire::LocalSender name) const noexcept;
  /// The name under which this client knows the device.
  wire::LocalSender nameFor(const Session& session) const noexcept;

  /// Whether the client may command; when not, `reason` says who may.
  bool mayCommand(const Session& session, std::string& reason);
  /// A client's control message: stop and re-arm, choices, questions. `received`: when the server read it.
  void onControl(Session& session, const wire::MessageReceived& message, base::Nanos received);
  /// The scene of this device was put back to the beginning.
  void onReset();
  /// The client listens to this name from now on.
  void onSubscribed(Session& session, wire::LocalSender name);
  void clientGone(scene::ClientId client);

  /// How the device and its loop are; `scene` is left to the caller.
  DeviceStatus status() const;
  /// The rate that the client has chosen, and whether it may command.
  double rateOf(const Session& session) const;
  bool couldCommand(const Session& session) const;

  /// Of a recorded device: clients hear this report. One thread.
  void play(const realtime::TickReport& report) noexcept;

  /// Readable when reports wait.
  int wakeFd() const noexcept;
  /// Encodes, once for all clients who chose alike, what the servo has reported, and calls onTick() after
  /// each tick that says something, so that ticks leave in their order. False when there was none.
  bool collectReports(const WallClock& clock, const std::function<void()>& onTick);
  /// Queues what collectReports() encoded.
  void sendReports(Session& session);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd::server

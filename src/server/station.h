// A station: one haptic device with its scene, its servo and its names.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "net/send_queue.h"
#include "server/config.h"
#include "server/reporter.h"
#include "server/scene_thread.h"
#include "server/session.h"

namespace hapticd::server {

/// Ties the threads of one device together: commands in, reports out. Lives in the net thread.
class Station {
 public:
  /// Called from the scene thread.
  struct Callbacks {
    std::function<void(std::vector<scene::Notice>&&)> notices;
    std::function<void()> drained;
  };

  /// Opens the device. Throws ConfigError or std::runtime_error with a remedy.
  Station(const DeviceConfig& config, std::vector<wire::LocalSender> names, bool allowNoRealtime);
  ~Station();

  /// Starts the scene and the servo. Throws std::runtime_error when the loop gets no realtime rights and must
  /// have them.
  void start(Callbacks callbacks);
  /// Zero force, then everything ends. Idempotent.
  void stop();

  /// Logs what the driver complains of, when it changed. Call it about once a second.
  void checkHealth();

  bool has(wire::LocalSender name) const noexcept;
  /// The name under which this client knows the device.
  wire::LocalSender nameFor(const Session& session) const noexcept;

  /// A client's message: scene commands are gathered, questions answered.
  void onMessage(Session& session, const wire::MessageReceived& message);
  /// Hands the gathered commands to the scene; false when it is so far behind that reading should pause.
  bool flushCommands();
  /// What the client owns ramps out; with the last that had commanded it the scene goes, too, if so
  /// configured.
  void clientGone(scene::ClientId client);

  /// Readable when reports wait.
  int wakeFd() const noexcept;
  /// Encodes, once for all clients, what the servo has reported; false when there was nothing to say.
  bool collectReports(const WallClock& clock);
  /// Queues what collectReports() encoded.
  void sendReports(Session& session) const;
  /// Queues the present state of everything, under one name.
  void sendPresentState(Session& session, wire::LocalSender name) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd::server

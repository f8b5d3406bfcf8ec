// A station: one haptic device with its servo, its names and its reports.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "record/recorder.h"
#include "server/config/config.h"
#include "server/reports/outbox.h"
#include "server/scene/scene_thread.h"
#include "server/session/refusal_codes.h"
#include "server/session/roles.h"
#include "server/session/session.h"
#include "server/station/device_status.h"

namespace hapticd::server {

class SceneHost;

/// Connects one device and its servo to the net thread: reports out, control in. Net thread.
class Station {
 public:
  /// Opens the device and adds it to the scene. Throws ConfigError or std::runtime_error with a remedy.
  Station(const DeviceConfig& config, std::vector<DeviceName> names, SceneHost& scene, bool allowNoRealtime);
  /// A station without hardware and servo, for the reports of a recorded device; no client may command it.
  Station(const DeviceConfig& config, std::vector<DeviceName> names, SceneHost& scene,
          const record::RecordedDevice& recorded);
  ~Station();

  /// Starts the servo. Throws std::runtime_error when realtime scheduling is required and refused.
  void start();
  /// Stops the force, ends the loop and closes the device. Idempotent.
  void stop();
  /// After stop(): writes the ticks before a fault. A disk may hang, so close all devices first.
  void finishBlackBox();

  /// Any thread: stops the forces until a re-arm.
  void stopForces() noexcept;
  /// Any thread: ramps the force in from zero, as after a reset of the scene.
  void rampIn() noexcept;
  /// Any thread: forces are enabled and not stopped, and there is a person to feel them.
  bool armed() const noexcept;
  /// Any thread: the device has had a zero since stopForces(), or the servo has not run.
  bool isStoppedAtZero() const noexcept;

  /// Reopens a lost device; logs changes of its fault and returns the text for the clients. Call several
  /// times per second.
  std::optional<wire::Text> checkHealth();
  /// Writes a frozen black box to a file. Call several times per second.
  void checkBlackBox();

  /// The device as a recording describes it.
  record::RecordedDevice recorded() const;
  /// Scene thread, or before it starts: records the scene and the ticks as the device of this number; null:
  /// ends. The recorder must live until finishedAfter() the end, or the servo has ended.
  /// `builder`: of the device, where the recording begins while the servo runs.
  void recordTo(record::Recorder* recording, std::uint32_t number,
                const scene::SceneBuilder* builder = nullptr);
  /// Any thread: a tick has ended after this time, or no loop runs.
  bool finishedAfter(base::Nanos time) const noexcept;

  SceneHost& scene() noexcept;
  bool has(wire::LocalSender name) const noexcept;
  /// The device name that this client subscribed to; by default the first one.
  wire::LocalSender nameFor(const Session& session) const noexcept;

  /// Shares the control of its scene with another device of it.
  void shareControlWith(const Station& other);
  /// Whether the client's role and the control of the scene permit this message; if not, `reason` is set.
  /// Scene commands take control where the first one to command gets it.
  bool mayCommand(const Commander& client, wire::MessageKind kind, std::string& reason);
  /// Whether the message lets go of the hand that the client holds: it always may.
  bool letsGo(scene::ClientId client, const wire::MessageReceived& message) const;
  /// Holds a force in the device frame for this client, within the budget of energy of all held forces.
  /// Returns why not, or an empty text; the same text at most once a second.
  Refusal holdForce(scene::ClientId client, const geometry::Vec3& force_N, base::Nanos lifetime,
                    base::Nanos received);
  /// Handles a control message. `received`: when the server read it, on the servo clock. `hasOperators`: see
  /// Credentials. `hasSocket`: the server has its Unix socket.
  void onControl(Session& session, const wire::MessageReceived& message, base::Nanos received,
                 bool hasOperators, bool hasSocket);
  /// The scene of this device was reset: trackers are reported in the device frame again.
  void onReset();
  /// The client is connected and has described no name yet.
  void onConnected(Session& session);
  /// Sends the client the present state under all names that it wants.
  void sendPresentState(Session& session);
  /// The client subscribed to this name.
  void onSubscribed(Session& session, wire::LocalSender name);
  /// The client is gone: its remote contacts and its held force fade.
  void endStreams(scene::ClientId client);
  /// The server ends the connection, which lasts until the client has read why. The client's streams fade,
  /// and it has neither the hand nor control any more.
  void clientEnds(scene::ClientId client);
  void clientGone(scene::ClientId client);
  /// The client belongs to the program with this key.
  void setKey(scene::ClientId client, std::uint64_t key);
  /// As clientGone(), for a connection of VRPN. A re-arm of it that still waits for the scene does not act:
  /// returns the text for the other clients.
  std::optional<wire::Text> sessionGone(Session& session);

  /// The newest tick that the net thread has; its number is 0 before the first.
  const realtime::TickReport& lastTick() const noexcept;
  /// The name that stands for the device where it can have only one.
  const std::string& name() const noexcept;
  /// State of the device and its loop; the caller fills in `scene`.
  DeviceStatus status() const;
  /// The report rate that the client chose.
  double rateOf(const Session& session) const;
  /// Whether the client may command, without giving it control.
  bool couldCommand(const Commander& client) const;

  /// Reports a tick of a recorded device. From one thread only.
  void play(const realtime::TickReport& report) noexcept;

  /// Descriptor that is readable when reports wait.
  int wakeFd() const noexcept;
  /// While report() is to be called again: encodes the pending ticks and sends them to those that connected
  /// first, who do not wait until all of a crowd got theirs.
  void reportToFirst(const WallClock& clock, const Sessions& clients);
  /// Encodes the pending ticks, once for all clients with the same subscription, and sends them to all
  /// clients, for FreshTicks::kSlice at most. When the net thread is behind, only the newest ticks are
  /// reported, see FreshTicks. When newer ticks came half-way, the next pass sends them to the clients
  /// before, also without a new tick. Returns whether clients remain in this pass: call it again soon.
  bool report(const WallClock& clock, const Sessions& clients);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd::server

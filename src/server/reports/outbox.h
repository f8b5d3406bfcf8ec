// Encodes ticks for many clients: each report once for all clients with the same subscription.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "net/send_queue.h"
#include "server/reports/reporter.h"
#include "server/session/session.h"
#include "server/session/wall_clock.h"
#include "wire/frame_encoder.h"

namespace hapticd::server {

/// The reports of one device and their subscriptions. Net thread.
class Outbox {
 public:
  /// `names`: the senders under which clients know the device.
  Outbox(const DeviceConfig& config, int buttonCount, std::vector<DeviceName> names);

  /// Prepares reports for a client that has connected: under all names, until it describes some.
  void join(Session& session);
  /// Sends the client the present state under all names that it wants.
  void sendPresentState(Session& session);
  /// Subscribes the client to this name and sends it the present state.
  void subscribe(Session& session, wire::LocalSender name);
  /// The subscription of the client, the same for all names; the default until choose().
  ReportChoice choiceOf(scene::ClientId client) const;
  void choose(Session& session, const ReportChoice& choice);
  /// The client knows the extensions: unless it chooses, it gets all tracker sensors.
  void extend(Session& session);
  void clientGone(scene::ClientId client);
  /// A reporter with the choice of the client, for answers under this name.
  Reporter reporterFor(scene::ClientId client, wire::LocalSender name) const;

  /// Encodes what the tick changed, for every group of clients. `late`: a newer tick waits, see
  /// Reporter::skip().
  void add(const realtime::TickReport& tick, const ReportFrame& frame, wire::Time time, bool late = false);
  /// Encodes one reliable message for all clients.
  void add(const wire::Message& message, wire::Time time);
  /// Collects what was added since the last call, for send(); false when there was nothing.
  bool collect();
  /// Queues the collected reports that this client subscribed to.
  void send(Session& session);

  /// The newest tick; its number is 0 until there is one.
  const realtime::TickReport& last() const noexcept { return last_; }

 private:
  // All clients with the same subscription to one name.
  struct Group {
    Group(wire::LocalSender name_, Reporter reporter_) : name(name_), reporter(std::move(reporter_)) {}
    void add(const Outgoing& out, wire::Time time);

    wire::LocalSender name;
    Reporter reporter;
    wire::FrameEncoder lowLatency, reliable;
    std::shared_ptr<const net::Buffer> lowLatencyFrames, reliableFrames;
    std::uint64_t skipped = 0;  // ticks skipped before these frames
  };
  struct Listener {
    ReportChoice choice;
    bool chosen = false;    // by choose() or extend()
    std::size_t names = 0;  // Session::namesWanted() when the groups were chosen
    std::vector<std::shared_ptr<Group>> groups;
  };

  Listener& listener(const Session& session);
  void regroup(const Session& session, Listener& listener);
  std::shared_ptr<Group> group(const DeviceName& name, const ReportChoice& choice);
  void sendPresentState(Session& session, wire::LocalSender name, const Group& group);

  const DeviceConfig config_;
  const int buttonCount_;
  const std::vector<DeviceName> names_;
  const ReportChoice defaultChoice_;
  std::map<scene::ClientId, Listener> listeners_;
  // A group lives as long as a client is in it.
  std::map<std::pair<std::int32_t, ReportChoice>, std::weak_ptr<Group>> groups_;
  realtime::TickReport last_;
  wire::Time lastTime_;
  ReportFrame frame_;
  std::vector<Outgoing> outgoing_;
};

}  // namespace hapticd::server

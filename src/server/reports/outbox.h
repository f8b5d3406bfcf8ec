// From ticks to bytes for many clients: who hears what, each report encoded once for all who chose alike.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "net/send_queue.h"
#include "server/session/wall_clock.h"
#include "server/reports/reporter.h"
#include "server/session/session.h"
#include "wire/frame_encoder.h"

namespace hapticd::server {

/// The reports of one device. Net thread.
class Outbox {
 public:
  /// `names` are the device's, each a sender of its own.
  Outbox(const DeviceConfig& config, int buttonCount, std::vector<wire::LocalSender> names);

  /// The client hears this name from now on: it gets the present state at once.
  void subscribe(Session& session, wire::LocalSender name);
  /// What the client has chosen, under all names; the default until it chooses.
  ReportChoice choiceOf(scene::ClientId client) const;
  void choose(Session& session, const ReportChoice& choice);
  void clientGone(scene::ClientId client);

  /// Says what the tick changed to every group of clients.
  void add(const realtime::TickReport& tick, const ReportFrame& frame, wire::Time time);
  /// Says one thing to all.
  void add(const wire::Message& message, wire::Time time);
  /// Hands over what was added since the last time; false when there was nothing.
  bool collect();
  /// Queues what collect() handed over and this client listens to.
  void send(Session& session);

  const realtime::TickReport& last() const noexcept { return last_; }

 private:
  // All clients with one choice, under one name.
  struct Group {
    Group(wire::LocalSender name_, Reporter reporter_) : name(name_), reporter(std::move(reporter_)) {}
    void add(const Outgoing& out, wire::Time time);

    wire::LocalSender name;
    Reporter reporter;
    wire::FrameEncoder lowLatency, reliable;
    std::shared_ptr<const net::Buffer> lowLatencyFrames, reliableFrames;
  };
  struct Listener {
    ReportChoice choice;
    std::size_t names = 0;  // that the groups were chosen for
    std::vector<std::shared_ptr<Group>> groups;
  };

  Listener& listener(const Session& session);
  void regroup(const Session& session, Listener& listener);
  std::shared_ptr<Group> group(wire::LocalSender name, const ReportChoice& choice);
  void tellPresentState(Session& session, wire::LocalSender name, const Group& group);

  const DeviceConfig config_;
  const int buttonCount_;
  const std::vector<wire::LocalSender> names_;
  const ReportChoice defaultChoice_;
  std::map<scene::ClientId, Listener> listeners_;
  // Groups live as long as somebody is in them.
  std::map<std::pair<std::int32_t, ReportChoice>, std::weak_ptr<Group>> groups_;
  realtime::TickReport last_;
  wire::Time lastTime_;
  ReportFrame frame_;
  std::vector<Outgoing> outgoing_;
};

}  // namespace hapticd::server

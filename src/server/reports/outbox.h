// Encodes ticks for many clients: each report once for all clients with the same subscription.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "server/reports/report_group.h"
#include "server/session/session.h"

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
  /// The kinds stay as they are.
  void setRate(Session& session, double rate_Hz);
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
  /// Makes what was added since the last call a link of each group's chain; false when there was nothing.
  bool collect();
  /// Begins a pass of send() over all clients.
  void beginPass();
  /// Queues what this client does not have yet of the reports that it subscribed to, see
  /// ReportGroup::advance(). Returns the number of low-latency sends under one name.
  std::size_t send(Session& session, std::size_t most);

  /// The newest tick; its number is 0 until there is one.
  const realtime::TickReport& last() const noexcept { return newest_->tick; }

 private:
  struct Member {
    std::shared_ptr<ReportGroup> group;
    ReportGroup::Position position = 0;
  };
  struct Listener {
    ReportChoice choice;
    bool chosen = false;    // by choose()
    std::size_t names = 0;  // Session::namesWanted() when the groups were chosen
    std::vector<Member> groups;
  };

  Listener& listener(const Session& session);
  void regroup(const Session& session, Listener& listener);
  std::shared_ptr<ReportGroup> group(const DeviceName& name, const ReportChoice& choice);
  void sendPresentState(Session& session, const ReportGroup& group);

  const DeviceConfig config_;
  const int buttonCount_;
  const std::vector<DeviceName> names_;
  const ReportChoice defaultChoice_;
  std::map<scene::ClientId, Listener> listeners_;
  // A group lives as long as a client is in it.
  std::map<std::pair<std::int32_t, ReportChoice>, std::weak_ptr<ReportGroup>> groups_;
  std::shared_ptr<const TimedTick> newest_ = std::make_shared<TimedTick>();
};

}  // namespace hapticd::server

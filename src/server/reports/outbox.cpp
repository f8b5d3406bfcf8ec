#include "server/reports/outbox.h"

#include <algorithm>

namespace hapticd::server {
namespace {

std::shared_ptr<const net::Buffer> takeBuffer(wire::FrameEncoder& encoder) {
  if (encoder.empty()) return nullptr;
  net::Buffer bytes;
  encoder.swapOut(bytes);
  return std::make_shared<const net::Buffer>(std::move(bytes));
}

}  // namespace

void Outbox::Group::add(const Outgoing& out, wire::Time time) {
  const wire::Reliability usual = wire::info(out.message.kind()).reliability;
  const bool mayBeLost = !out.reliable && usual == wire::Reliability::kLowLatency;
  (mayBeLost ? lowLatency : reliable).add(time, name, out.message);
}

Outbox::Outbox(const DeviceConfig& config, int buttonCount, std::vector<DeviceName> names)
    : config_(config),
      buttonCount_(buttonCount),
      names_(std::move(names)),
      defaultChoice_(defaultChoice(config)) {}

void Outbox::join(Session& session) {
  regroup(session, listener(session));
}

void Outbox::sendPresentState(Session& session) {
  Listener& entry = listener(session);
  regroup(session, entry);
  for (const auto& group : entry.groups) sendPresentState(session, group->name, *group);
}

void Outbox::subscribe(Session& session, wire::LocalSender name) {
  Listener& entry = listener(session);
  regroup(session, entry);
  for (const auto& group : entry.groups) {
    if (group->name == name) sendPresentState(session, name, *group);
  }
}

ReportChoice Outbox::choiceOf(scene::ClientId client) const {
  const auto entry = listeners_.find(client);
  return entry == listeners_.end() ? defaultChoice_ : entry->second.choice;
}

void Outbox::choose(Session& session, const ReportChoice& choice) {
  Listener& entry = listener(session);
  entry.chosen = true;
  entry.choice = withMirrors(config_, choice);
  sendPresentState(session);
}

void Outbox::extend(Session& session) {
  if (listener(session).chosen) return;
  ReportChoice choice = choiceOf(session.id());
  choice.kinds |= wire::kReportHip | wire::kReportContactPoint;
  choose(session, choice);
}

void Outbox::clientGone(scene::ClientId client) {
  listeners_.erase(client);
}

Reporter Outbox::reporterFor(scene::ClientId client, wire::LocalSender name) const {
  const auto known = std::find_if(names_.begin(), names_.end(),
                                  [name](const DeviceName& entry) { return entry.sender == name; });
  return {config_, buttonCount_, choiceOf(client), known == names_.end() ? View::device : known->view};
}

Outbox::Listener& Outbox::listener(const Session& session) {
  return listeners_
      .try_emplace(session.id(),
                   Listener{.choice = defaultChoice_, .chosen = false, .names = 0, .groups = {}})
      .first->second;
}

void Outbox::regroup(const Session& session, Listener& listener) {
  std::vector<std::shared_ptr<Group>> groups;
  for (const DeviceName& name : names_) {
    if (session.wants(name.sender)) groups.push_back(group(name, listener.choice));
  }
  listener.groups = std::move(groups);
  listener.names = session.namesWanted();
}

std::shared_ptr<Outbox::Group> Outbox::group(const DeviceName& name, const ReportChoice& choice) {
  std::erase_if(groups_, [](const auto& entry) { return entry.second.expired(); });
  std::weak_ptr<Group>& known = groups_[{name.sender.value, choice}];
  std::shared_ptr<Group> group = known.lock();
  if (!group) {
    known = group = std::make_shared<Group>(name.sender, Reporter(config_, buttonCount_, choice, name.view));
  }
  return group;
}

void Outbox::sendPresentState(Session& session, wire::LocalSender name, const Group& group) {
  if (last_.tick == 0) return;  // add() reports the state with the first tick
  std::vector<Outgoing> messages;
  group.reporter.presentState(last_, frame_, messages);
  for (const Outgoing& out : messages) session.sendReliably(name, out.message, lastTime_);
  session.flush();
}

void Outbox::add(const realtime::TickReport& tick, const ReportFrame& frame, wire::Time time, bool late) {
  const bool first = last_.tick == 0;
  last_ = tick;
  lastTime_ = time;
  frame_ = frame;
  for (const auto& [key, weak] : groups_) {
    const std::shared_ptr<Group> group = weak.lock();
    if (!group) continue;
    outgoing_.clear();
    // Clients that subscribed before the first tick still need the initial state.
    if (first) {
      group->reporter.presentState(tick, frame, outgoing_);
    } else if (late) {
      group->reporter.skip(tick, frame, outgoing_);
    } else {
      group->reporter.update(tick, frame, outgoing_);
    }
    for (const Outgoing& out : outgoing_) group->add(out, time);
  }
}

void Outbox::add(const wire::Message& message, wire::Time time) {
  for (const auto& [key, weak] : groups_) {
    if (const std::shared_ptr<Group> group = weak.lock()) group->add({message, true}, time);
  }
}

bool Outbox::collect() {
  bool any = false;
  for (const auto& [key, weak] : groups_) {
    const std::shared_ptr<Group> group = weak.lock();
    if (!group) continue;
    group->lowLatencyFrames = takeBuffer(group->lowLatency);
    group->reliableFrames = takeBuffer(group->reliable);
    any = any || group->lowLatencyFrames || group->reliableFrames;
  }
  if (!any) return false;
  for (const auto& [key, weak] : groups_) {
    if (const std::shared_ptr<Group> group = weak.lock()) group->skipped = group->reporter.takeSkipped();
  }
  return true;
}

void Outbox::send(Session& session) {
  Listener& entry = listener(session);
  if (entry.groups.empty() || entry.names != session.namesWanted()) regroup(session, entry);
  for (const auto& group : entry.groups) {
    session.countSkipped(group->skipped);
    if (group->lowLatencyFrames) session.sendShared(group->lowLatencyFrames, net::Delivery::lowLatency);
    if (group->reliableFrames) session.sendShared(group->reliableFrames, net::Delivery::reliable);
  }
}

}  // namespace hapticd::server

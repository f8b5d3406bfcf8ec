#include "server/reports/outbox.h"

#include <algorithm>

namespace hapticd::server {
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
  for (const Member& member : entry.groups) sendPresentState(session, *member.group);
}

void Outbox::subscribe(Session& session, wire::LocalSender name) {
  Listener& entry = listener(session);
  regroup(session, entry);
  for (const Member& member : entry.groups) {
    if (member.group->name() == name) sendPresentState(session, *member.group);
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

void Outbox::setRate(Session& session, double rate_Hz) {
  listener(session).choice.rate_Hz = rate_Hz;
  sendPresentState(session);
}

void Outbox::extend(Session& session) {
  Listener& entry = listener(session);
  constexpr std::uint32_t kSensors = wire::kReportHip | wire::kReportContactPoint;
  if (entry.chosen || (entry.choice.kinds & kSensors) == kSensors) return;
  entry.choice.kinds |= kSensors;
  entry.choice = withMirrors(config_, entry.choice);
  sendPresentState(session);
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
  std::vector<Member> groups;
  for (const DeviceName& name : names_) {
    if (!session.wants(name.sender)) continue;
    const auto wanted = group(name, listener.choice);
    const auto member = std::find_if(listener.groups.begin(), listener.groups.end(),
                                     [&](const Member& known) { return known.group == wanted; });
    groups.push_back({wanted, member == listener.groups.end() ? wanted->end() : member->position});
  }
  listener.groups = std::move(groups);
  listener.names = session.namesWanted();
}

std::shared_ptr<ReportGroup> Outbox::group(const DeviceName& name, const ReportChoice& choice) {
  std::erase_if(groups_, [](const auto& entry) { return entry.second.expired(); });
  std::weak_ptr<ReportGroup>& known = groups_[{name.sender.value, choice}];
  std::shared_ptr<ReportGroup> group = known.lock();
  if (!group) known = group = std::make_shared<ReportGroup>(config_, buttonCount_, choice, name);
  return group;
}

void Outbox::sendPresentState(Session& session, const ReportGroup& group) {
  if (newest_->tick.tick == 0) return;  // add() reports the state with the first tick
  group.presentState(*newest_, [&](const wire::Message& message, wire::Time time) {
    session.sendReliably(group.name(), message, time);
  });
  session.flush();
}

void Outbox::add(const realtime::TickReport& tick, const ReportFrame& frame, wire::Time time, bool late) {
  const bool first = newest_->tick.tick == 0;
  newest_ = std::make_shared<const TimedTick>(TimedTick{tick, frame, time});
  for (const auto& [key, weak] : groups_) {
    const std::shared_ptr<ReportGroup> group = weak.lock();
    if (!group) continue;
    // Clients that subscribed before the first tick still need the initial state.
    if (first) {
      group->addFirst(*newest_);
    } else {
      group->add(newest_, late);
    }
  }
}

void Outbox::add(const wire::Message& message, wire::Time time) {
  for (const auto& [key, weak] : groups_) {
    if (const std::shared_ptr<ReportGroup> group = weak.lock()) group->add(message, time);
  }
}

bool Outbox::collect() {
  bool any = false;
  for (const auto& [key, weak] : groups_) {
    if (const std::shared_ptr<ReportGroup> group = weak.lock()) any = group->collect() || any;
  }
  return any;
}

void Outbox::beginPass() {
  for (const auto& [key, weak] : groups_) {
    if (const std::shared_ptr<ReportGroup> group = weak.lock()) group->beginPass();
  }
}

std::size_t Outbox::send(Session& session, std::size_t most) {
  Listener& entry = listener(session);
  if (entry.groups.empty() || entry.names != session.namesWanted()) regroup(session, entry);
  std::size_t reports = 0;
  for (Member& member : entry.groups) {
    const auto sent = member.group->advance(
        member.position, most, [&session](const ReportGroup::Frames& frames, net::Delivery delivery) {
          session.sendShared(frames, delivery);
        });
    session.countSkipped(sent.skipped);
    reports = std::max(reports, sent.reports);
  }
  return reports;
}

}  // namespace hapticd::server

#include "sim/listener_judge.h"

#include <iterator>
#include <utility>

namespace hapticd::sim {

// Ten times a second, and once after each connection that was accepted.
void ListenerJudge::onRefused(const net::Endpoint& local, std::size_t pending) {
  constexpr int kMost = 20;
  const Nanos now = clock_.time();
  Listener& listener = listeners_[local.text()];
  if (now - listener.second >= 1'000 * kMs) {
    listener.second = now;
    listener.count = 0;
  }
  if (++listener.count == kMost + 1)
    finding_("without descriptors the server tries to accept more than " + std::to_string(kMost) +
             " times in a second at " + local.text());
  if (pending > 0 && !listener.waitsSince) listener.waitsSince = now - scheduler_.netStalled();
}

void ListenerJudge::onLogged(const std::string& line) {
  constexpr char kBegin[] = "cannot accept a connection on ";
  if (!line.starts_with(kBegin)) return;
  const std::size_t begin = std::size(kBegin) - 1;
  const std::string where = line.substr(begin, line.rfind(": ") - begin);
  Listener& listener = listeners_[where];
  const Nanos now = clock_.time();
  if (listener.loggedAt && now - *listener.loggedAt < 900 * kMs)
    finding_("the log reports twice in a second that no connection can be accepted on " + where);
  listener.loggedAt = now;
  listener.logged = now - scheduler_.netStalled();
}

void ListenerJudge::onDescriptorsBack() {
  for (auto& [where, listener] : listeners_) {
    const auto since = std::exchange(listener.waitsSince, std::nullopt);
    if (since && (!listener.logged || *listener.logged < *since - 1'000 * kMs))
      finding_("connections have waited at " + where + " for a descriptor, and the log does not report it");
  }
}

}  // namespace hapticd::sim

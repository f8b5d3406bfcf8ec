// What the listeners of a server must do while it is out of descriptors.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "net/endpoint.h"
#include "sim/scheduler.h"

namespace hapticd::sim {

/// Listeners seldom try to accept, and the log has one line a second for each at which somebody waits.
class ListenerJudge {
 public:
  ListenerJudge(const Scheduler& scheduler, const SimClock& clock,
                std::function<void(const std::string&)> finding)
      : scheduler_(scheduler), clock_(clock), finding_(std::move(finding)) {}

  /// An attempt to accept at `local`, where `pending` connections wait, was refused.
  void onRefused(const net::Endpoint& local, std::size_t pending);
  /// A line of the log.
  void onLogged(const std::string& line);
  void onDescriptorsBack();

 private:
  struct Listener {
    Nanos second = 0;                      // when the present second of `count` began
    int count = 0;                         // attempts to accept in it
    std::optional<Nanos> waitsSince = {};  // without stalls of the server
    std::optional<Nanos> loggedAt = {};
    std::optional<Nanos> logged = {};  // the same without stalls
  };

  const Scheduler& scheduler_;
  const SimClock& clock_;
  const std::function<void(const std::string&)> finding_;
  std::map<std::string, Listener> listeners_;  // by address
};

}  // namespace hapticd::sim

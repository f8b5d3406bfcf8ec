// Whom the server admits, and whom it ends because of its limits.
#pragma once

#include <array>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/time.h"
#include "server/config/config.h"
#include "server/session/session.h"

namespace hapticd::server {

/// Limits on connections, on unfinished handshakes and on memory. A client beyond the first may still stop
/// forces. Net thread.
class Admission {
 public:
  /// Both must outlive this object.
  Admission(const LimitsConfig& limits, const Sessions& sessions) : limits_(limits), sessions_(sessions) {}

  /// Whether there is room for one client more of this source.
  bool hasRoom(const std::string& source) const;
  /// Counts a client that is no session, and one less.
  void enter(const std::string& source);
  void leave(const std::string& source);
  /// Before the session is among the server's sessions. Others may end for it.
  void enter(Session& session);
  void leave(const Session& session);
  /// The client has sent its greeting.
  void greeted(const Session& session) { unfinished_.erase(session.id()); }
  /// Whether the client came beyond the limits.
  bool mayOnlyStop(const Session& session) const noexcept;
  /// Ends the handshakes that take too long. Returns the sessions whose handshake was completed since the
  /// last call.
  std::vector<Session*> completedHandshakes(base::Nanos now);
  /// Counts the memory that waits for a client, and `commands`, bytes of it that wait for scenes. Ends the
  /// client beyond its own limit.
  void countMemory(Session& session, std::size_t commands);
  /// All clients were counted once since the last call: ends the largest, until the rest is within the limit.
  void judgeMemory();

 private:
  const LimitsConfig& limits_;
  const Sessions& sessions_;
  std::size_t others_ = 0;                         // clients that are no sessions
  std::map<std::string, std::size_t> fromSource_;  // clients of all kinds
  // Clients beyond the limits, oldest first. Each kind of way has a reserve of its own: a flood on one must
  // not keep a stop on another from its turn.
  std::array<std::deque<scene::ClientId>, 3> reserves_;
  std::map<scene::ClientId, base::Nanos> handshakes_;             // start times of unfinished handshakes
  std::set<scene::ClientId> unfinished_;                          // without a greeting, oldest first
  std::vector<std::pair<std::size_t, scene::ClientId>> counted_;  // memory and client
};

}  // namespace hapticd::server

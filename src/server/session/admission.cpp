#include "server/session/admission.h"

#include <sys/resource.h>

#include <algorithm>

namespace hapticd::server {
namespace {

constexpr base::Nanos kHandshakeLimit = 30'000'000'000;
constexpr std::size_t kReserve = 16;              // connections that may only stop forces
constexpr std::uint64_t kOtherDescriptors = 192;  // devices, files, the web port, pending connections

// The program may raise it: see docs/limits.md.
std::size_t mostSessions(std::size_t configured) {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  const std::uint64_t present = limit.rlim_cur;
  // In mode udp a client takes two.
  const std::uint64_t possible = present > 2 * kOtherDescriptors ? (present - kOtherDescriptors) / 2 : 16;
  return std::min<std::size_t>(configured, possible);
}

// The way on which a client came: Unix socket, this machine, another machine.
std::size_t wayOf(const Session& session) {
  if (session.mode() == SessionMode::local) return 0;
  return net::isLoopback(session.remote().address) ? 1 : 2;
}

// What a client does not read is freed at once; it would not read the text either.
void end(Session& session, const std::string& reason) {
  constexpr std::size_t kUnread_bytes = 64 * 1024;
  if (session.status().queuedBytes > kUnread_bytes) {
    session.abort(reason);
  } else {
    session.refuse(reason);
  }
}

}  // namespace

bool Admission::hasRoom(const std::string& source) const {
  std::size_t present = sessions_.size() + others_;
  for (const auto& reserve : reserves_) present -= reserve.size();
  const auto ofSource = fromSource_.find(source);
  return present < mostSessions(static_cast<std::size_t>(limits_.connections)) &&
         (ofSource == fromSource_.end() ||
          ofSource->second < static_cast<std::size_t>(limits_.connectionsPerAddress));
}

void Admission::enter(const std::string& source) {
  ++others_;
  ++fromSource_[source];
}

void Admission::leave(const std::string& source) {
  --others_;
  const auto ofSource = fromSource_.find(source);
  if (--ofSource->second == 0) fromSource_.erase(ofSource);
}

void Admission::enter(Session& session) {
  const auto find = [this](scene::ClientId id) {
    const auto found = sessions_.find(id);
    return found == sessions_.end() ? nullptr : found->second.get();
  };
  const bool room = hasRoom(session.source());
  ++fromSource_[session.source()];
  handshakes_.emplace(session.id(), base::now());
  unfinished_.insert(session.id());
  // The newest ones have the chance to greet: a stop must not wait for a flood of silent connections.
  if (unfinished_.size() > static_cast<std::size_t>(limits_.unfinishedConnections)) {
    Session* const oldest = find(*unfinished_.begin());
    unfinished_.erase(unfinished_.begin());
    if (oldest) oldest->abort("no VRPN greeting so far, and others wait to greet");
  }
  if (room) return;
  // The newest ones may stop forces: those that hold on to this must not keep others from it.
  auto& reserve = reserves_[wayOf(session)];
  reserve.push_back(session.id());
  // At once, without a last text: a flood must not take all descriptors. Those that ended wait to leave.
  std::size_t open = 1;  // the new one
  for (auto id = reserve.rbegin(); id != reserve.rend(); ++id) {
    Session* const other = find(*id);
    if (other == nullptr || other->ending()) continue;
    if (++open > kReserve) other->abort("the server is full, and others wait to stop forces");
  }
}

void Admission::leave(const Session& session) {
  handshakes_.erase(session.id());
  unfinished_.erase(session.id());
  std::erase(reserves_[wayOf(session)], session.id());
  const auto ofSource = fromSource_.find(session.source());
  if (--ofSource->second == 0) fromSource_.erase(ofSource);
}

bool Admission::mayOnlyStop(const Session& session) const noexcept {
  const auto& reserve = reserves_[wayOf(session)];
  return std::find(reserve.begin(), reserve.end(), session.id()) != reserve.end();
}

std::vector<Session*> Admission::completedHandshakes(base::Nanos now) {
  std::vector<Session*> done;
  for (auto entry = handshakes_.begin(); entry != handshakes_.end();) {
    const auto session = sessions_.find(entry->first);
    if (session == sessions_.end() || session->second->connected()) {
      if (session != sessions_.end()) done.push_back(session->second.get());
      entry = handshakes_.erase(entry);
      continue;
    }
    if (now - entry->second > kHandshakeLimit) session->second->close("no VRPN greeting within 30 s");
    ++entry;
  }
  return done;
}

void Admission::countMemory(Session& session, std::size_t commands) {
  if (session.ending()) return;
  const std::size_t bytes = session.memory() + commands;
  if (bytes > static_cast<std::size_t>(limits_.clientMemory_MB) << 20) {
    end(session, "this client uses more than " + std::to_string(limits_.clientMemory_MB) +
                     " MiB of the server; send less at a time, and read");
  } else if (bytes > 0) {
    counted_.emplace_back(bytes, session.id());
  }
}

void Admission::judgeMemory() {
  const auto most = static_cast<std::size_t>(limits_.memory_MB) << 20;
  std::size_t sum = 0;
  for (const auto& [bytes, client] : counted_) sum += bytes;
  if (sum > most) std::sort(counted_.rbegin(), counted_.rend());
  for (const auto& [bytes, client] : counted_) {
    if (sum <= most) break;
    sum -= bytes;
    const auto session = sessions_.find(client);
    if (session == sessions_.end()) continue;
    end(*session->second, "all clients together use more than " + std::to_string(limits_.memory_MB) +
                              " MiB of the server, and this one uses most");
  }
  counted_.clear();
}

}  // namespace hapticd::server

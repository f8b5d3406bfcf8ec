// A thread for the handshakes of a server: the signature of one takes 4 ms with an RSA key of 4096 bits, and
// strangers can ask for thousands of them.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>

#include "base/thread.h"

namespace hapticd::tls {

/// Runs jobs one at a time, in turn by the addresses of the peers, so that nobody waits for all of another
/// address.
class Handshakes {
 public:
  Handshakes() = default;
  ~Handshakes() { stop(); }
  Handshakes(const Handshakes&) = delete;
  Handshakes& operator=(const Handshakes&) = delete;

  /// Always from the same thread; the first call starts the other one.
  void post(std::uint32_t address, std::function<void()> job);
  /// Waits for the running job and discards the others; jobs that are posted afterwards are discarded, too.
  void stop();

 private:
  std::optional<base::Nanos> step();
  std::function<void()> next();

  std::mutex mutex_;
  std::map<std::uint32_t, std::deque<std::function<void()>>> jobs_;  // no empty queues
  std::uint32_t last_ = 0;                                           // address of the last job
  bool stopped_ = false;
  base::Thread thread_;  // last: its step uses the others
};

}  // namespace hapticd::tls

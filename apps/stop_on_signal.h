// Signals that would end or stop a server bring its forces to zero first.
#pragma once

#include <atomic>
#include <csignal>
#include <mutex>
#include <thread>

#include "server/server.h"

namespace hapticd::apps {

/// Blocks the signals in the calling thread, so construct it before any other thread starts, and handles them
/// in a thread of its own that waits for no other. SIGINT, SIGTERM, SIGHUP, SIGQUIT and all others that by
/// default end a process end the server in order; before there is one, while its devices open and calibrate,
/// they end the process at once. SIGTSTP stops the forces before it stops the process; they stay stopped when
/// it continues. SIGPIPE, SIGXFSZ and those of a background process at a terminal are ignored. A crash is not
/// handled: see docs/safety.md.
class StopOnSignal {
 public:
  StopOnSignal();
  ~StopOnSignal() { finish(); }
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

  /// Signals concern this server from now on, until finish(). One that has not ended 10 s after a signal is
  /// ended by _exit().
  void watch(server::Server& server);
  /// Its thread uses the server no more. Idempotent; the destructor calls it.
  void finish();

 private:
  void run();
  void end(server::Server& server, int signal);

  sigset_t signals_{};
  std::mutex mutex_;
  server::Server* server_ = nullptr;
  std::atomic<bool> leaving_{false};
  std::thread thread_;
};

}  // namespace hapticd::apps

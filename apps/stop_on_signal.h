// SIGINT and SIGTERM shut a server down in order: zero force first.
#pragma once

#include <pthread.h>

#include <csignal>
#include <thread>

#include "server/server.h"

namespace hapticd::apps {

/// Blocks both signals in the calling thread, so construct it before any other thread starts.
class StopOnSignal {
 public:
  StopOnSignal() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  }
  /// Calls server.stop() at the first signal, from a separate thread; `server` outlives this.
  void watch(server::Server& server) {
    thread_ = std::thread([this, &server] {
      int signal = 0;
      sigwait(&signals_, &signal);
      server.stop();
    });
  }
  ~StopOnSignal() {
    if (!thread_.joinable()) return;
    pthread_kill(thread_.native_handle(), SIGTERM);
    thread_.join();
  }

 private:
  sigset_t signals_{};
  std::thread thread_;
};

}  // namespace hapticd::apps

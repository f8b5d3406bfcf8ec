// SIGINT and SIGTERM shut a server down in order: zero force first.
#pragma once

#include <pthread.h>

#include <atomic>
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
  /// Calls server.stop() at the first signal, from a separate thread, until finish().
  void watch(server::Server& server) {
    thread_ = std::thread([this, &server] {
      int signal = 0;
      sigwait(&signals_, &signal);
      if (!finished_) server.stop();
    });
  }
  /// Call it before the server ends: its thread uses the server no more. Idempotent.
  void finish() {
    if (!thread_.joinable()) return;
    finished_ = true;
    pthread_kill(thread_.native_handle(), SIGTERM);
    thread_.join();
  }
  ~StopOnSignal() { finish(); }

 private:
  sigset_t signals_{};
  std::atomic<bool> finished_{false};
  std::thread thread_;
};

}  // namespace hapticd::apps

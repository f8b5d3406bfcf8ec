#include "stop_on_signal.h"

#include <pthread.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>

namespace hapticd::apps {
namespace {

constexpr int kIgnored[] = {SIGPIPE, SIGXFSZ, SIGTTIN, SIGTTOU};
// By default these end the process.
constexpr int kEnding[] = {SIGINT,    SIGTERM, SIGHUP,  SIGQUIT, SIGUSR1, SIGUSR2,  SIGALRM,
                           SIGVTALRM, SIGPROF, SIGXCPU, SIGIO,   SIGPWR,  SIGSTKFLT};
constexpr timespec kLongestEnd{10, 0};

bool isIgnored(int signal) {
  struct sigaction present {};
  return sigaction(signal, nullptr, &present) == 0 && present.sa_handler == SIG_IGN;
}

}  // namespace

StopOnSignal::StopOnSignal() {
  for (const int signal : kIgnored) std::signal(signal, SIG_IGN);
  sigemptyset(&signals_);
  for (const int signal : kEnding) {
    // nohup and the like have their reasons. A shell ignores SIGINT for its background jobs.
    if (signal == SIGINT || !isIgnored(signal)) sigaddset(&signals_, signal);
  }
  for (int signal = SIGRTMIN; signal <= SIGRTMAX; ++signal) sigaddset(&signals_, signal);
  sigaddset(&signals_, SIGTSTP);
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  thread_ = std::thread([this] { run(); });
}

void StopOnSignal::finish() {
  if (!thread_.joinable()) return;
  leaving_ = true;
  pthread_kill(thread_.native_handle(), SIGTERM);
  thread_.join();
}

void StopOnSignal::watch(server::Server& server) {
  const std::lock_guard lock(mutex_);
  server_ = &server;
}

void StopOnSignal::run() {
  for (;;) {
    int signal = 0;
    sigwait(&signals_, &signal);
    if (leaving_) return;
    std::unique_lock lock(mutex_);
    if (server_ == nullptr) {
      // No loop runs, so no force is on; a driver may block in its library, or move the arm to calibrate it.
      if (signal != SIGTSTP) _exit(0);
      kill(getpid(), SIGSTOP);
      continue;
    }
    server::Server& server = *server_;
    lock.unlock();
    const bool atZero = server.stopForces();
    if (signal != SIGTSTP) return end(server, signal);
    spdlog::warn("{}: forces are stopped{}; the process stops", strsignal(signal),
                 atZero ? "" : " by the watchdog");
    kill(getpid(), SIGSTOP);
    spdlog::warn("continued; forces stay stopped until re-armed");
  }
}

void StopOnSignal::end(server::Server& server, int signal) {
  spdlog::info("{}: ending", strsignal(signal));
  server.stop();
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  const std::time_t deadline = now.tv_sec + kLongestEnd.tv_sec;
  while (now.tv_sec < deadline) {
    const timespec rest{deadline - now.tv_sec, 0};
    sigtimedwait(&signals_, nullptr, &rest);
    if (leaving_) return;
    clock_gettime(CLOCK_MONOTONIC, &now);
  }
  const bool closed = server.devicesClosed();
  spdlog::error("the server did not end within {} s: {}", kLongestEnd.tv_sec,
                closed ? "the devices are closed; leaving the scene as it is" : "a device does not close");
  _exit(closed ? 0 : 3);
}

}  // namespace hapticd::apps

#include "stop_signals.h"

#include <csignal>
#include <stdexcept>

namespace hapticd::apps {
namespace {

constexpr int kHandled[] = {SIGINT, SIGTERM, SIGQUIT, SIGHUP};
volatile std::sig_atomic_t requested = 0;

void request(int) {
  requested = 1;
}

}  // namespace

StopSignals::StopSignals() {
  static_assert(std::tuple_size_v<decltype(before_)> == std::size(kHandled));
  for (std::size_t i = 0; i < before_.size(); ++i) {
    before_[i] = std::signal(kHandled[i], request);
    if (before_[i] == SIG_IGN) std::signal(kHandled[i], SIG_IGN);
  }
}

StopSignals::~StopSignals() {
  for (std::size_t i = 0; i < before_.size(); ++i) std::signal(kHandled[i], before_[i]);
}

bool stopRequested() {
  return requested != 0;
}

void throwIfStopped() {
  if (stopRequested()) throw std::runtime_error("interrupted: nothing is written");
}

}  // namespace hapticd::apps

#include "stop_signals.h"

#include <csignal>

namespace hapticd::apps {
namespace {

volatile std::sig_atomic_t requested = 0;

void request(int) {
  requested = 1;
}

}  // namespace

StopSignals::StopSignals()
    : interrupt_(std::signal(SIGINT, request)), terminate_(std::signal(SIGTERM, request)) {}

StopSignals::~StopSignals() {
  std::signal(SIGINT, interrupt_);
  std::signal(SIGTERM, terminate_);
}

bool stopRequested() {
  return requested != 0;
}

}  // namespace hapticd::apps

#include "bench/witness.h"

#include "bench/timing.h"
#include "realtime/servo/pacer.h"

namespace hapticd::bench {

Witness::Witness() : thread_([this] { watch(); }) {}

Witness::~Witness() {
  stop_ = true;
  thread_.join();
}

void Witness::watch() noexcept {
  becomeRealtime();
  realtime::Pacer pacer(nowNs(), realtime::servoPeriod(1000));
  while (!stop_) {
    sleepUntilNs(pacer.deadline());
    late_ = pacer.begin(nowNs()).overruns;
  }
}

}  // namespace hapticd::bench

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

Row witnessRow(std::uint64_t late, std::optional<std::uint64_t> undisturbed) {
  Row row{"- a bare thread beside it: wakes over 0.5 ms late",
          "",
          Summary::of(static_cast<double>(late)),
          {},
          {},
          {}};
  if (undisturbed) row.yardstick = Summary::of(static_cast<double>(*undisturbed));
  return row;
}

}  // namespace hapticd::bench

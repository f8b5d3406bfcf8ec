// How late the loop wakes, against cyclictest with the same priority and interval.
#include <cstdlib>
#include <sstream>

#include "bench/all.h"
#include "bench/server_process.h"
#include "bench/servo_loop.h"

namespace hapticd::bench {
namespace {

// Lines of "microseconds count", as cyclictest -h prints them.
Samples histogramOf(const std::string& output) {
  Samples samples;
  std::istringstream lines(output);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    double us = 0;
    std::uint64_t count = 0;
    if (line.empty() || line[0] == '#' || !(words >> us >> count)) continue;
    for (std::uint64_t i = 0; i < count; ++i) samples.add(us);
  }
  return samples;
}

Samples cyclictest(int seconds) {
  const WorkDirectory work;
  // Without --laptop it would forbid the processor to sleep, which our loop does not ask for.
  ChildProcess process("cyclictest",
                       {"-q", "-m", "--laptop", "-t", "1", "-p", "80", "-i", "1000", "-h", "20000", "-D",
                        std::to_string(seconds)},
                       work / "log");
  const int code = process.wait();
  if (code != 0) throw std::runtime_error("cyclictest failed: " + process.output());
  return histogramOf(process.output());
}

bool hasCyclictest() {
  return std::system("command -v cyclictest >/dev/null 2>&1") == 0;
}

}  // namespace

Outcome measureWakeup(const Run& run) {
  Outcome outcome;
  const bool yardstick = hasCyclictest();
  const int rounds = static_cast<int>(run.seconds(2, 12, 12));
  Samples ours;
  Samples theirs;
  bool granted = true;
  for (int round = 0; round < rounds; ++round) {
    run.progress("round " + std::to_string(round + 1) + " of " + std::to_string(rounds));
    {
      ServoLoop loop;
      granted = granted && loop.realtimeGranted();
      loop.observe(0.2);
      ours.add(loop.observe(5).wakeup_us);
    }
    if (yardstick) theirs.add(cyclictest(5));
  }
  Row row{"wake-up error", "us", ours.summary(), std::nullopt, {}, {}};
  const std::string reason = !granted     ? "no SCHED_FIFO"
                             : !yardstick ? "no cyclictest (Debian: rt-tests)"
                                          : "";
  if (yardstick) row.yardstick = theirs.summary();
  const auto against = [&](double a, double b) { return b > 0 ? a / b : 0; };
  const Summary t = row.yardstick.value_or(Summary{});
  row.checks.push_back({"p99 ratio", against(row.ours.p99, t.p99), 1.2, false, reason});
  row.checks.push_back({"p99.9 ratio", against(row.ours.p999, t.p999), 1.5, false, reason});
  outcome.rows.push_back(row);
  outcome.figures.push_back({"wakeup",
                             "Wake-up error of the loop and of cyclictest",
                             "us",
                             0,
                             120,
                             {{"hapticd", ours}, {"cyclictest", theirs}}});
  return outcome;
}

}  // namespace hapticd::bench

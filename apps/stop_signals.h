// The signals that ask a program to end, as a flag.
#pragma once

#include <array>

namespace hapticd::apps {

/// While it lives, SIGINT (Ctrl-C), SIGTERM, SIGQUIT and SIGHUP (a closed terminal) set a flag instead of
/// ending the process; one that is ignored stays so, as by nohup. One instance at a time.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  using Handler = void (*)(int);
  std::array<Handler, 4> before_{};
};

/// Whether one of them arrived.
bool stopRequested();
/// Throws std::runtime_error when one did: for work that leaves nothing behind when it ends early.
void throwIfStopped();

}  // namespace hapticd::apps

// SIGINT (Ctrl-C) and SIGTERM as a flag.
#pragma once

namespace hapticd::apps {

/// While it lives, SIGINT and SIGTERM set a flag instead of ending the process. One instance at a time.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  using Handler = void (*)(int);
  Handler interrupt_;
  Handler terminate_;
};

/// Whether one of the two signals arrived.
bool stopRequested();

}  // namespace hapticd::apps

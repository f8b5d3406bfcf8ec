// Ctrl-C and SIGTERM as a flag.
#pragma once

namespace hapticd::apps {

/// Turns SIGINT and SIGTERM into a flag as long as it lives. One at a time.
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

/// Whether one of them has come.
bool stopRequested();

}  // namespace hapticd::apps

// The log of a server: to the standard output, by a thread of its own, so that nobody waits for its reader.
#pragma once

#include <memory>

namespace hapticd::apps {

/// While it lives, spdlog's default logger writes through a bounded queue. A queue that is full because
/// nobody reads the output drops lines and counts them. Construct it after StopOnSignal, so that its thread
/// takes no signals.
class LogWriter {
 public:
  LogWriter();
  /// Writes the rest for at most half a second.
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

 private:
  class Queue;
  std::shared_ptr<Queue> queue_;  // the thread outlives this when its reader blocks it
};

}  // namespace hapticd::apps

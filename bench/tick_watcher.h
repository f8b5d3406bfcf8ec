// A client that hears every tick of a server: gaps in the loop, and how late the reports are.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>

#include "bench/samples.h"

namespace hapticd::bench {

struct Watched {
  Samples latency_us;                ///< from the start of the tick to the callback
  std::uint64_t ticks = 0;           ///< that were heard of
  std::uint64_t lost = 0;            ///< that were not
  std::uint64_t overruns = 0;        ///< starts more than 0.5 ms later after the one before than they should
  double longestGap_ms = 0;          ///< between two starts
  std::uint64_t revisions = 0;       ///< changes of the scene that was felt
  std::int64_t lastRevision_ns = 0;  ///< when the first tick with the newest scene was heard of
  bool touching = false;             ///< in the last tick
};

/// Watches in a thread of its own, from construction to destruction.
class TickWatcher {
 public:
  /// Connects to the device; throws as hapticd::Client does.
  explicit TickWatcher(const std::string& device);
  ~TickWatcher();
  TickWatcher(const TickWatcher&) = delete;
  TickWatcher& operator=(const TickWatcher&) = delete;

  /// What was seen since the last call.
  Watched take();

 private:
  void watch(const std::string& device);

  std::atomic<bool> stop_{false};
  std::atomic<bool> ready_{false};
  std::mutex mutex_;
  Watched seen_;
  std::string error_;
  std::thread thread_;
};

}  // namespace hapticd::bench

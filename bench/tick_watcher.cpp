#include "bench/tick_watcher.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>

#include "bench/timing.h"
#include "hapticd/client.h"

namespace hapticd::bench {
namespace {

using namespace std::chrono_literals;

constexpr std::int64_t kWatchPeriod_ns = 1'000'000;
constexpr std::int64_t kLate_ns = 500'000;

}  // namespace

TickWatcher::TickWatcher(const std::string& device) : thread_([this, device] { watch(device); }) {
  for (int i = 0; i < 1000 && !ready_; ++i) std::this_thread::sleep_for(10ms);
  const std::lock_guard lock(mutex_);
  if (!ready_ || !error_.empty()) {
    stop_ = true;
    thread_.join();
    throw std::runtime_error(error_.empty() ? "no ticks are heard of within 10 s" : error_);
  }
}

TickWatcher::~TickWatcher() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

Watched TickWatcher::take() {
  const std::lock_guard lock(mutex_);
  Watched seen = std::move(seen_);
  seen_ = {};
  seen_.touching = seen.touching;
  seen_.lastRevision_ns = seen.lastRevision_ns;
  return seen;
}

void TickWatcher::watch(const std::string& device) try {
  Client client(device);
  client.subscribe(Reports::tick, 1000);
  TickReport before;
  client.onTick([&](const TickReport& tick) {
    const std::int64_t now = nowNs();
    const std::lock_guard lock(mutex_);
    ++seen_.ticks;
    seen_.latency_us.add(static_cast<double>(now - tick.tickTime.count()) * 1e-3);
    seen_.touching = tick.object >= 0;
    if (before.tick > 0 && tick.tick > before.tick) {
      const auto steps = static_cast<std::int64_t>(tick.tick - before.tick);
      const std::int64_t gap = (tick.tickTime - before.tickTime).count();
      seen_.lost += static_cast<std::uint64_t>(steps - 1);
      if (gap - steps * kWatchPeriod_ns > kLate_ns) ++seen_.overruns;
      if (steps == 1) seen_.longestGap_ms = std::max(seen_.longestGap_ms, static_cast<double>(gap) * 1e-6);
      if (tick.revision != before.revision) {
        ++seen_.revisions;
        seen_.lastRevision_ns = now;
      }
    }
    before = tick;
    ready_ = true;
  });
  while (!stop_) client.poll(50ms);
} catch (const std::exception& error) {
  const std::lock_guard lock(mutex_);
  error_ = error.what();
  ready_ = true;
}

}  // namespace hapticd::bench

#include "tls/handshakes.h"

#include <exception>
#include <utility>

namespace hapticd::tls {

void Handshakes::post(std::uint32_t address, std::function<void()> job) {
  {
    const std::lock_guard lock(mutex_);
    if (stopped_) return;
    jobs_[address].push_back(std::move(job));
  }
  if (thread_.running()) {
    thread_.wake();
  } else {
    thread_ = base::Thread({.name = "tls", .niceness = 10}, [this] { return step(); });
  }
}

void Handshakes::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    jobs_.clear();
  }
  thread_.stop();
}

std::optional<base::Nanos> Handshakes::step() {
  while (const auto job = next()) {
    try {
      job();
    } catch (const std::exception&) {
      // Out of memory: the peer gets no answer, and is disconnected as one that never greets.
    }
  }
  return std::nullopt;
}

std::function<void()> Handshakes::next() {
  const std::lock_guard lock(mutex_);
  if (jobs_.empty()) return {};
  auto queue = jobs_.upper_bound(last_);
  if (queue == jobs_.end()) queue = jobs_.begin();
  last_ = queue->first;
  auto job = std::move(queue->second.front());
  queue->second.pop_front();
  if (queue->second.empty()) jobs_.erase(queue);
  return job;
}

}  // namespace hapticd::tls

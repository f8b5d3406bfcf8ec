// The last seconds before a fault, kept until another thread takes them.
//
// Protocol: the servo records while `frozen_` is false, and only the servo sets the flag; the other thread
// reads the cells while the flag is true, and only that thread clears it. So no cell is read while it is
// written.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <vector>

#include "realtime/servo/report.h"

namespace hapticd::realtime {

/// Ring of the newest reports. Allocates in the constructor only.
class BlackBox {
 public:
  explicit BlackBox(std::size_t ticks) : cells_(std::max<std::size_t>(ticks, 1)) {}

  /// Servo: stores the report in place of the oldest. Ignored while frozen.
  void record(const TickReport& report) noexcept {
    if (frozen_.load(std::memory_order_acquire)) return;
    cells_[next_] = report;
    next_ = next_ + 1 == cells_.size() ? 0 : next_ + 1;
    count_ = std::min(count_ + 1, cells_.size());
  }
  /// Servo: stops recording until take().
  void freeze() noexcept { frozen_.store(true, std::memory_order_release); }

  /// Any other thread: true between freeze() and take().
  bool frozen() const noexcept { return frozen_.load(std::memory_order_acquire); }
  /// One other thread: returns the reports up to the fault, oldest first, and restarts recording. Empty when
  /// not frozen. Allocates.
  std::vector<TickReport> take() {
    std::vector<TickReport> reports;
    if (!frozen()) return reports;
    reports.reserve(count_);
    const std::size_t oldest = (next_ + cells_.size() - count_) % cells_.size();
    for (std::size_t i = 0; i < count_; ++i) reports.push_back(cells_[(oldest + i) % cells_.size()]);
    count_ = 0;
    frozen_.store(false, std::memory_order_release);
    return reports;
  }

 private:
  std::vector<TickReport> cells_;
  std::size_t next_ = 0;
  std::size_t count_ = 0;
  std::atomic<bool> frozen_{false};
};

}  // namespace hapticd::realtime

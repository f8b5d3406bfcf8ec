// Whether a zero force that was written has left, for a driver that sends in a thread of its own.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>

namespace hapticd::device {

/// Commands have rising numbers from 1. Of a run of zeros the first one counts: a sender that takes the
/// newest command only may never catch up with the last.
class SentZero {
 public:
  /// Servo thread.
  void wrote(std::uint64_t number, bool zero) noexcept {
    if (!zero) {
      first_ = kNone;
    } else if (first_ == kNone) {
      first_ = number;
    }
  }
  /// The one sender: this command, or zero instead of it, has left.
  void sent(std::uint64_t number) noexcept { sent_.store(number, std::memory_order_release); }
  /// Servo thread: the newest command is zero, and one of its run has left.
  bool isSent() const noexcept { return isSent(sent_.load(std::memory_order_acquire)); }
  /// The same where the sender counts elsewhere: in another process.
  bool isSent(std::uint64_t sent) const noexcept { return first_ != kNone && sent >= first_; }

 private:
  static constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t first_ = kNone;
  std::atomic<std::uint64_t> sent_{0};
};

}  // namespace hapticd::device

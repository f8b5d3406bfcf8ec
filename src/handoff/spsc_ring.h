// A wait-free queue between one producing and one consuming thread.
//
// Protocol: only the producer writes `head_`, the number of pushed items; only the consumer writes `tail_`,
// the number of consumed items. A cell belongs to the producer from the moment `tail_` passes it until
// `head_` does, and to the consumer otherwise. Both calls finish in a bounded number of steps.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace hapticd::handoff {

/// Ring of copies of T. Allocates in the constructor only.
template <class T>
class SpscRing {
  // Eigen does not declare its copies noexcept; a type with a trivial destructor owns no memory.
  static_assert(std::is_trivially_destructible_v<T>, "a copy must not allocate");

 public:
  /// Holds at least `capacity` items, rounded up to a power of two.
  explicit SpscRing(std::size_t capacity)
      : cells_(std::bit_ceil(std::max<std::size_t>(capacity, 1))), mask_(cells_.size() - 1) {}
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;

  /// Producer: appends a copy. When the ring is full, returns false and counts a drop.
  bool push(const T& item) noexcept {
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_.load(std::memory_order_acquire) > mask_) {
      dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
      return false;
    }
    cells_[head & mask_] = item;
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

  /// Consumer: passes all items present at the call to visit(const T&), oldest first, and returns how many. A
  /// cell is free again as soon as its visit ends. A visit(const T&, std::size_t) also gets the number of
  /// newer items present.
  template <class Visit>
  std::size_t consume(Visit&& visit) {
    std::uint64_t tail = tail_.load(std::memory_order_relaxed);
    const std::uint64_t head = head_.load(std::memory_order_acquire);
    const std::size_t count = head - tail;
    while (tail != head) {
      const T& item = cells_[tail & mask_];
      if constexpr (std::is_invocable_v<Visit&, const T&, std::size_t>) {
        visit(item, static_cast<std::size_t>(head - tail - 1));
      } else {
        visit(item);
      }
      tail_.store(++tail, std::memory_order_release);
    }
    return count;
  }

  /// Number of items that a full ring refused. Any thread.
  std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }
  std::size_t capacity() const noexcept { return cells_.size(); }

 private:
  std::vector<T> cells_;
  const std::uint64_t mask_;
  alignas(64) std::atomic<std::uint64_t> head_{0};
  std::atomic<std::uint64_t> dropped_{0};
  alignas(64) std::atomic<std::uint64_t> tail_{0};
};

}  // namespace hapticd::handoff

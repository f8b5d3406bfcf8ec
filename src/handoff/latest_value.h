// The newest small value from one thread to another; older values are dropped.
//
// Protocol (triple buffer): three cells, one owned by the writer, one by the reader, one in the middle. A
// write fills the writer's cell and exchanges it with the middle one, marked as fresh; a read exchanges the
// reader's cell with the middle one if that is fresh. No thread touches a cell of the other.
//
// Also between processes, in shared memory: whatever the other process leaves there, each side accesses only
// the three cells.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

namespace hapticd::handoff {

/// One writer, one reader; both wait-free.
template <class T>
class LatestValue {
  // Eigen does not declare its copies noexcept; a type with a trivial destructor owns no memory.
  static_assert(std::is_trivially_destructible_v<T>, "a copy must not allocate");

 public:
  LatestValue() = default;
  LatestValue(const LatestValue&) = delete;
  LatestValue& operator=(const LatestValue&) = delete;

  /// Writer: replaces the value.
  void write(const T& value) noexcept {
    const std::uint8_t cell = valid(writing_);
    cells_[cell] = value;
    writing_ = middle_.exchange(cell | kFresh, std::memory_order_acq_rel) & kIndex;
  }

  /// Reader: the newest value, default-constructed before the first write. Valid until the next read.
  const T& read() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) != 0) {
      reading_ = middle_.exchange(valid(reading_), std::memory_order_acq_rel) & kIndex;
    }
    return cells_[valid(reading_)];
  }

 private:
  static constexpr std::uint8_t valid(std::uint8_t cell) noexcept { return cell < 3 ? cell : 0; }

  static constexpr std::uint8_t kIndex = 3;
  static constexpr std::uint8_t kFresh = 4;

  std::array<T, 3> cells_{};
  alignas(64) std::atomic<std::uint8_t> middle_{1};
  alignas(64) std::uint8_t writing_ = 0;
  alignas(64) std::uint8_t reading_ = 2;
};

}  // namespace hapticd::handoff

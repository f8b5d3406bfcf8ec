// How long things took, in logarithmic buckets, readable while it is being filled.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::realtime {

using base::Nanos;

/// Durations from 0 ns to 17 s in buckets at most 1/8 wide of their lower bound. One thread adds (wait-free),
/// any thread reads; a reader may miss the newest few.
class Histogram {
 public:
  static constexpr int kSubBits = 3;
  static constexpr int kSub = 1 << kSubBits;
  static constexpr int kBuckets = (34 - kSubBits + 1) * kSub;

  /// What was counted up to the moment of the copy.
  struct Copy {
    std::array<std::uint64_t, kBuckets> counts{};
    std::uint64_t total = 0;
    std::uint64_t sum_ns = 0;
    Nanos max = 0;

    /// Upper bound of the bucket that holds the given share (0…1) of all values, at most `max`; 0 when empty.
    Nanos quantile(double share) const noexcept {
      const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(total)));
      std::uint64_t seen = 0;
      for (int i = 0; i < kBuckets; ++i) {
        seen += counts[static_cast<std::size_t>(i)];
        if (seen >= wanted && seen > 0) return std::min(upperBound(i), max);
      }
      return max;
    }
  };

  void add(Nanos value) noexcept {
    if (value < 0) value = 0;
    bump(counts_[static_cast<std::size_t>(bucketOf(value))], 1);
    bump(sum_, static_cast<std::uint64_t>(value));
    if (value > max_.load(std::memory_order_relaxed)) max_.store(value, std::memory_order_relaxed);
  }

  Copy copy() const noexcept {
    Copy out;
    for (int i = 0; i < kBuckets; ++i) {
      const auto at = static_cast<std::size_t>(i);
      out.counts[at] = counts_[at].load(std::memory_order_relaxed);
      out.total += out.counts[at];
    }
    out.sum_ns = sum_.load(std::memory_order_relaxed);
    out.max = max_.load(std::memory_order_relaxed);
    return out;
  }

  /// The bucket of a value: values below 8 have their own, larger ones eight to an octave.
  static constexpr int bucketOf(Nanos value) noexcept {
    const auto v = static_cast<std::uint64_t>(value);
    if (v < kSub) return static_cast<int>(v);
    const int shift = std::bit_width(v) - 1 - kSubBits;
    const int bucket = (shift + 1) * kSub + static_cast<int>((v >> shift) & (kSub - 1));
    return bucket < kBuckets ? bucket : kBuckets - 1;
  }
  /// Largest value of a bucket; the last bucket holds everything above, too.
  static constexpr Nanos upperBound(int bucket) noexcept {
    if (bucket < kSub) return bucket;
    const int shift = bucket / kSub - 1;
    return ((static_cast<Nanos>(kSub + bucket % kSub) + 1) << shift) - 1;
  }

 private:
  // One writer: a load and a store are enough.
  static void bump(std::atomic<std::uint64_t>& counter, std::uint64_t by) noexcept {
    counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
  }

  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<std::uint64_t> sum_{0};
  std::atomic<Nanos> max_{0};
};

}  // namespace hapticd::realtime

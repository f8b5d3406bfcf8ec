// Histograms with logarithmic buckets: 8 per octave, so that a bucket is at most 1/8 of its lower bound wide.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/time.h"

namespace hapticd::base {

/// Bucket arithmetic for values of any unit. Values below 8 have their own buckets. noexcept, no allocation.
namespace log_buckets {

inline constexpr int kSubBits = 3;
inline constexpr int kPerOctave = 1 << kSubBits;

/// The bucket of a value; the last of `count` buckets also holds everything above it.
constexpr int bucketOf(std::uint64_t value, int count) noexcept {
  if (value < kPerOctave) return std::min(static_cast<int>(value), count - 1);
  const int shift = std::bit_width(value) - 1 - kSubBits;
  const int bucket = (shift + 1) * kPerOctave + static_cast<int>((value >> shift) & (kPerOctave - 1));
  return std::min(bucket, count - 1);
}

/// Largest value of a bucket.
constexpr std::int64_t upperBound(int bucket) noexcept {
  if (bucket < kPerOctave) return bucket;
  const int shift = bucket / kPerOctave - 1;
  return ((static_cast<std::int64_t>(kPerOctave + bucket % kPerOctave) + 1) << shift) - 1;
}

constexpr std::uint64_t total(std::span<const std::uint64_t> counts) noexcept {
  std::uint64_t sum = 0;
  for (const std::uint64_t count : counts) sum += count;
  return sum;
}

/// The bucket in which the smallest `share` (0…1) of all values ends; -1 when there are none.
inline int quantileBucket(std::span<const std::uint64_t> counts, double share) noexcept {
  const double rank = std::ceil(std::clamp(share, 0.0, 1.0) * static_cast<double>(total(counts)));
  const auto wanted = std::max<std::uint64_t>(static_cast<std::uint64_t>(rank), 1);
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    seen += counts[i];
    if (seen >= wanted) return static_cast<int>(i);
  }
  return -1;
}

}  // namespace log_buckets

/// Durations from 0 ns to 17 s. One thread adds (realtime: wait-free, noexcept, no allocation); any thread
/// copies at the same time and may miss the newest few values.
class Histogram {
 public:
  static constexpr int kBuckets = (34 - log_buckets::kSubBits + 1) * log_buckets::kPerOctave;

  /// The counts at the time of the copy.
  struct Copy {
    std::array<std::uint64_t, kBuckets> counts{};
    std::uint64_t total = 0;
    std::uint64_t sum_ns = 0;
    Nanos max = 0;

    /// Upper bound of the bucket in which the smallest `share` (0…1) of all values ends, at most `max`; 0
    /// when empty.
    Nanos quantile(double share) const noexcept {
      const int bucket = log_buckets::quantileBucket(counts, share);
      return bucket < 0 ? 0 : std::min(upperBound(bucket), max);
    }
    /// Adds the values of another histogram.
    Copy& operator+=(const Copy& other) noexcept {
      for (std::size_t i = 0; i < counts.size(); ++i) counts[i] += other.counts[i];
      total += other.total;
      sum_ns += other.sum_ns;
      max = std::max(max, other.max);
      return *this;
    }
  };

  /// Counts one value; negative ones count as 0.
  void add(Nanos value) noexcept {
    if (value < 0) value = 0;
    bump(counts_[static_cast<std::size_t>(bucketOf(value))], 1);
    bump(sum_, static_cast<std::uint64_t>(value));
    if (value > max_.load(std::memory_order_relaxed)) max_.store(value, std::memory_order_relaxed);
  }

  Copy copy() const noexcept {
    Copy out;
    for (std::size_t i = 0; i < counts_.size(); ++i)
      out.counts[i] = counts_[i].load(std::memory_order_relaxed);
    out.total = log_buckets::total(out.counts);
    out.sum_ns = sum_.load(std::memory_order_relaxed);
    out.max = max_.load(std::memory_order_relaxed);
    return out;
  }

  static constexpr int bucketOf(Nanos value) noexcept {
    return log_buckets::bucketOf(static_cast<std::uint64_t>(value), kBuckets);
  }
  /// Largest value of a bucket; the last bucket also holds everything above.
  static constexpr Nanos upperBound(int bucket) noexcept { return log_buckets::upperBound(bucket); }

 private:
  // One writer: a load and a store are enough.
  static void bump(std::atomic<std::uint64_t>& counter, std::uint64_t by) noexcept {
    counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
  }

  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<std::uint64_t> sum_{0};
  std::atomic<Nanos> max_{0};
};

}  // namespace hapticd::base

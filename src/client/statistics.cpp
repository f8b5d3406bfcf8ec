#include "hapticd/statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace hapticd {
namespace {

// Eight buckets per octave; below 8 us, one per microsecond.
constexpr std::uint64_t kSteps = 8;

std::size_t bucketOf(std::uint64_t us) noexcept {
  if (us < kSteps) return static_cast<std::size_t>(us);
  const auto octave = static_cast<std::uint64_t>(std::bit_width(us)) - 4;  // 0 for 8 to 15
  const std::uint64_t index = kSteps + octave * kSteps + ((us >> octave) - kSteps);
  return static_cast<std::size_t>(std::min<std::uint64_t>(index, LatencyHistogram::kBuckets - 1));
}

/// The first value above the bucket.
double upperEnd_us(std::size_t bucket) noexcept {
  if (bucket < kSteps) return static_cast<double>(bucket + 1);
  const std::size_t octave = (bucket - kSteps) / kSteps;
  const std::size_t step = (bucket - kSteps) % kSteps + kSteps;
  return std::ldexp(static_cast<double>(step + 1), static_cast<int>(octave));
}

}  // namespace

void LatencyHistogram::add(std::chrono::microseconds latency) noexcept {
  ++buckets_[bucketOf(static_cast<std::uint64_t>(std::max<std::int64_t>(latency.count(), 0)))];
}

LatencyHistogram& LatencyHistogram::operator+=(const LatencyHistogram& other) noexcept {
  for (std::size_t i = 0; i < kBuckets; ++i) buckets_[i] += other.buckets_[i];
  return *this;
}

LatencyHistogram& LatencyHistogram::operator-=(const LatencyHistogram& earlier) noexcept {
  for (std::size_t i = 0; i < kBuckets; ++i) buckets_[i] -= earlier.buckets_[i];
  return *this;
}

std::uint64_t LatencyHistogram::count() const noexcept {
  std::uint64_t sum = 0;
  for (const std::uint64_t n : buckets_) sum += n;
  return sum;
}

double LatencyHistogram::quantile_us(double q) const noexcept {
  const auto rank =
      static_cast<std::uint64_t>(std::ceil(std::clamp(q, 0.0, 1.0) * static_cast<double>(count())));
  if (count() == 0) return 0;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    sum += buckets_[i];
    if (sum >= std::max<std::uint64_t>(rank, 1)) return upperEnd_us(i);
  }
  return upperEnd_us(kBuckets - 1);
}

std::uint64_t LatencyHistogram::countBelow_us(double limit_us) const noexcept {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < kBuckets && upperEnd_us(i) <= limit_us; ++i) sum += buckets_[i];
  return sum;
}

double Statistics::ratePerSecond(ReportKind kind, const Statistics& earlier) const {
  const double seconds = std::chrono::duration<double>(taken - earlier.taken).count();
  return seconds > 0 ? static_cast<double>((*this)[kind].count - earlier[kind].count) / seconds : 0;
}

}  // namespace hapticd

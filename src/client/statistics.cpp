#include "hapticd/statistics.h"

#include <algorithm>

#include "base/histogram.h"

namespace hapticd {
namespace {

namespace buckets = base::log_buckets;

int bucketOf(std::uint64_t us) noexcept {
  return buckets::bucketOf(us, static_cast<int>(LatencyHistogram::kBuckets));
}

/// The first value above the bucket.
double upperEnd_us(std::size_t bucket) noexcept {
  return static_cast<double>(buckets::upperBound(static_cast<int>(bucket)) + 1);
}

}  // namespace

void LatencyHistogram::add(std::chrono::microseconds latency) noexcept {
  const auto us = static_cast<std::uint64_t>(std::max<std::int64_t>(latency.count(), 0));
  ++buckets_[static_cast<std::size_t>(bucketOf(us))];
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
  return buckets::total(buckets_);
}

double LatencyHistogram::quantile_us(double q) const noexcept {
  const int bucket = buckets::quantileBucket(buckets_, q);
  return bucket < 0 ? 0 : upperEnd_us(static_cast<std::size_t>(bucket));
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

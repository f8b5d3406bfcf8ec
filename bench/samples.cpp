#include "bench/samples.h"

#include <algorithm>
#include <cmath>

namespace hapticd::bench {

double Samples::shareWithin(double from, double to) const noexcept {
  if (values_.empty()) return 0;
  const auto within =
      std::count_if(values_.begin(), values_.end(), [&](double v) { return v >= from && v < to; });
  return static_cast<double>(within) / static_cast<double>(values_.size());
}

Summary Samples::summary() const {
  Summary s;
  s.count = values_.size();
  if (values_.empty()) return s;
  std::vector<double> sorted = values_;
  std::sort(sorted.begin(), sorted.end());
  const auto n = static_cast<double>(sorted.size());
  for (const double value : sorted) s.mean += value / n;
  for (const double value : sorted) s.deviation += (value - s.mean) * (value - s.mean) / n;
  s.deviation = std::sqrt(s.deviation);
  const auto quantile = [&](double share) {
    const auto rank = static_cast<std::size_t>(std::ceil(share * n));
    return sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1];
  };
  s.p50 = quantile(0.5);
  s.p99 = quantile(0.99);
  s.p999 = quantile(0.999);
  s.max = sorted.back();
  return s;
}

}  // namespace hapticd::bench

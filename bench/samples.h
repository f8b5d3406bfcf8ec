// Measured values and what is said of them.
#pragma once

#include <cstdint>
#include <vector>

namespace hapticd::bench {

/// What a table shows of many values, in the unit of the row.
struct Summary {
  std::uint64_t count = 0;
  double mean = 0;
  double deviation = 0;  ///< standard deviation
  double p50 = 0;
  double p99 = 0;
  double p999 = 0;
  double max = 0;

  /// A figure that is measured once: a rate, a size.
  static Summary of(double value) { return {1, value, 0, value, value, value, value}; }
};

/// All values of one measurement. Quantiles are of the values themselves, not of buckets.
class Samples {
 public:
  void reserve(std::size_t count) { values_.reserve(count); }
  void add(double value) { values_.push_back(value); }
  void add(const Samples& other) {
    values_.insert(values_.end(), other.values_.begin(), other.values_.end());
  }

  bool empty() const noexcept { return values_.empty(); }
  std::size_t count() const noexcept { return values_.size(); }
  const std::vector<double>& values() const noexcept { return values_; }
  /// Share of the values in [from, to); 0 when there are none.
  double shareWithin(double from, double to) const noexcept;
  Summary summary() const;

 private:
  std::vector<double> values_;
};

}  // namespace hapticd::bench

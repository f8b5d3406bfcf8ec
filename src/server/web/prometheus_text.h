// The text format of Prometheus, version 0.0.4.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include "base/histogram.h"

namespace hapticd::server {

/// Writes metric families one after the other: call family() first, then add its samples.
class PrometheusText {
 public:
  using Labels = std::initializer_list<std::pair<std::string_view, std::string_view>>;

  /// `type`: counter, gauge or histogram. By convention a counter's name ends in _total, other names end in
  /// their unit.
  void family(std::string_view name, std::string_view type, std::string_view help);
  void sample(double value, Labels labels = {});
  /// Converts a histogram of nanoseconds to seconds, with a bucket for each power of two from 1 us to 0.5 s.
  void histogram(const base::Histogram::Copy& histogram, std::string_view device);

  const std::string& text() const noexcept { return text_; }

 private:
  void line(std::string_view ending, double value, Labels labels);

  std::string name_;
  std::string text_;
};

}  // namespace hapticd::server

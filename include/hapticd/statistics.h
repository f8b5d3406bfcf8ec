// Counts of what a client sent and received, and how late reports were.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "hapticd/reports.h"

namespace hapticd {

/// Times between a report's stamp and its arrival, in buckets of at most 12.5 % width up to a minute. The
/// clocks of two machines differ; on one machine the figure is true.
class LatencyHistogram {
 public:
  static constexpr std::size_t kBuckets = 192;

  /// Counts one latency; negative ones (clocks that disagree) count as 0.
  void add(std::chrono::microseconds latency) noexcept;
  LatencyHistogram& operator+=(const LatencyHistogram& other) noexcept;
  /// Takes away an earlier state of the same histogram, which leaves what came since.
  LatencyHistogram& operator-=(const LatencyHistogram& earlier) noexcept;

  std::uint64_t count() const noexcept;
  /// The latency below which the share q (0 to 1) lies, to the upper end of its bucket; 0 when empty.
  double quantile_us(double q) const noexcept;
  /// How many were below the limit, to the width of a bucket.
  std::uint64_t countBelow_us(double limit) const noexcept;

 private:
  std::array<std::uint64_t, kBuckets> buckets_{};
};

/// Reports of one kind.
struct ReportStatistics {
  std::uint64_t count = 0;
  LatencyHistogram latency;
};

/// Everything since the client was made, over all its connections.
struct Statistics {
  std::chrono::steady_clock::time_point taken;
  std::uint64_t connections = 0;
  std::uint64_t messages_out = 0;
  std::uint64_t messages_in = 0;
  std::uint64_t messages_dropped = 0;  ///< commands given while the connection was lost
  std::uint64_t messages_damaged = 0;  ///< reports that could not be decoded
  std::uint64_t tcp_bytes_out = 0;     ///< handed to the system
  std::uint64_t tcp_bytes_in = 0;
  std::uint64_t udp_bytes_out = 0;
  std::uint64_t udp_bytes_in = 0;
  std::array<ReportStatistics, kReportKinds> reports;  ///< by ReportKind

  const ReportStatistics& operator[](ReportKind kind) const {
    return reports[static_cast<std::size_t>(kind)];
  }
  /// Reports of this kind a second since an earlier copy.
  double ratePerSecond(ReportKind kind, const Statistics& earlier) const;
};

}  // namespace hapticd

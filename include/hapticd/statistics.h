// Counts of what a client sent and received, and the latency of reports.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "hapticd/export.h"
#include "hapticd/reports.h"

namespace hapticd {

/// Times from a report's stamp to its arrival, in buckets of at most 12.5 % width up to a minute. The stamp
/// is of the server's clock and the arrival of the client's, so the figures are true on one machine only.
class HAPTICD_EXPORT LatencyHistogram {
 public:
  static constexpr std::size_t kBuckets = 192;

  /// Counts one latency; a negative one (the clocks disagree) counts as 0.
  void add(std::chrono::microseconds latency) noexcept;
  LatencyHistogram& operator+=(const LatencyHistogram& other) noexcept;
  /// Subtracts an earlier copy of the same histogram, which leaves the counts since then.
  LatencyHistogram& operator-=(const LatencyHistogram& earlier) noexcept;

  std::uint64_t count() const noexcept;
  /// The quantile q (0 to 1), rounded up to the end of its bucket; 0 when empty.
  double quantile_us(double q) const noexcept;
  /// The number of latencies below the limit, to the width of a bucket.
  std::uint64_t countBelow_us(double limit_us) const noexcept;

 private:
  std::array<std::uint64_t, kBuckets> buckets_{};
};

/// Counts for reports of one kind.
struct ReportStatistics {
  std::uint64_t count = 0;
  LatencyHistogram latency;
};

/// Counts since the client was constructed, over all its connections.
struct HAPTICD_EXPORT Statistics {
  std::chrono::steady_clock::time_point taken;  ///< when this copy was made
  std::uint64_t connections = 0;
  std::uint64_t messagesOut = 0;
  std::uint64_t messagesIn = 0;
  std::uint64_t messagesDropped = 0;  ///< commands called while the connection was lost
  std::uint64_t messagesDamaged = 0;  ///< reports that could not be decoded
  std::uint64_t tcpBytesOut = 0;      ///< handed to the system
  std::uint64_t tcpBytesIn = 0;
  std::uint64_t udpBytesOut = 0;
  std::uint64_t udpBytesIn = 0;
  std::array<ReportStatistics, kReportKinds> reports;  ///< by ReportKind

  const ReportStatistics& operator[](ReportKind kind) const {
    return reports[static_cast<std::size_t>(kind)];
  }
  /// Reports of one kind per second since an earlier copy; 0 when no time has passed.
  double ratePerSecond(ReportKind kind, const Statistics& earlier) const;
};

}  // namespace hapticd

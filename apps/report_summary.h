// Contact, force and latency statistics over the reports of a server.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "hapticd/client.h"

namespace hapticd::apps {

/// Accumulates reports as they arrive. Times are the server's, so network delay does not affect them.
class ReportSummary {
 public:
  /// Counts from now on; `client` outlives this.
  explicit ReportSummary(Client& client);
  ReportSummary(const ReportSummary&) = delete;
  ReportSummary& operator=(const ReportSummary&) = delete;

  /// Clears all counts and starts again.
  void restart();

  double seconds() const;  ///< since construction or restart()
  double contactSeconds() const { return contact_s_; }
  double contactFraction() const;  ///< of the time between the first and the last touching report
  double peakForce_N() const { return peakForce_N_; }
  double meanForceTouching_N() const;  ///< mean over the force reports received while touching
  double deepest_m() const { return deepest_m_; }
  std::uint64_t reports() const;
  std::uint64_t count(ReportKind kind) const;
  /// Latency of pose and contact reports since construction or restart().
  LatencyHistogram latency() const;
  /// Texts of the server with their counts, in order of first appearance.
  const std::vector<std::pair<std::string, std::uint64_t>>& texts() const { return texts_; }
  /// The first text of an error other than a fault of the device, also from before restart(); empty: none.
  const std::string& firstError() const { return firstError_; }
  std::uint64_t forceErrors() const { return count(ReportKind::forceError); }

  /// For people: several lines, one figure per line.
  std::string text() const;
  /// For programs: the same figures as one line of JSON.
  std::string json() const;

 private:
  void onTouching(const TouchingReport& report);
  void onForce(const ForceReport& report);
  void onText(const TextReport& report);

  Client& client_;
  Statistics start_;
  std::chrono::steady_clock::time_point started_;
  TouchingReport lastTouching_;
  bool touchingKnown_ = false;
  double contact_s_ = 0;
  double observed_s_ = 0;
  double peakForce_N_ = 0;
  double forceSum_N_ = 0;
  std::uint64_t forceCount_ = 0;
  double deepest_m_ = 0;
  std::vector<std::pair<std::string, std::uint64_t>> texts_;
  std::string firstError_;
};

}  // namespace hapticd::apps

// What was felt during a watch, added up from the reports of a server.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "hapticd/client.h"

namespace hapticd::apps {

/// Adds up reports as they come; times are the server's, so that a late network changes nothing.
class Felt {
 public:
  /// Counts from now on; the client must live as long as this.
  explicit Felt(Client& client);
  Felt(const Felt&) = delete;
  Felt& operator=(const Felt&) = delete;

  /// Starts counting anew.
  void restart();

  double seconds() const;  ///< since the start
  double contactSeconds() const { return contact_s_; }
  double contactFraction() const;  ///< of the time between the first and the last word on touching
  double peakForce_N() const { return peak_force_N_; }
  double meanForceTouching_N() const;  ///< mean of the force reports that came while touching
  double deepest_m() const { return deepest_m_; }
  std::uint64_t reports() const;
  std::uint64_t count(ReportKind kind) const;
  /// Of the reports of motion and touch, since the start.
  LatencyHistogram latency() const;
  /// What the server said, and how often, in order of first appearance.
  const std::vector<std::pair<std::string, std::uint64_t>>& texts() const { return texts_; }
  std::uint64_t forceErrors() const { return count(ReportKind::forceError); }

  /// For people: several lines, one figure each.
  std::string summary() const;
  /// The same for programs: one line.
  std::string json() const;

 private:
  void onTouching(const TouchingReport& report);
  void onForce(const ForceReport& report);
  void onText(const TextReport& report);

  Client& client_;
  Statistics start_;
  std::chrono::steady_clock::time_point started_;
  TouchingReport last_touching_;
  bool touching_known_ = false;
  double contact_s_ = 0;
  double observed_s_ = 0;
  double peak_force_N_ = 0;
  double force_sum_N_ = 0;
  std::uint64_t force_count_ = 0;
  double deepest_m_ = 0;
  std::vector<std::pair<std::string, std::uint64_t>> texts_;
};

}  // namespace hapticd::apps

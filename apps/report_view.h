// The latest reports for people: a table on a terminal, one line per interval elsewhere.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "report_summary.h"

namespace hapticd::apps {

/// Values as UTF-8 bars with a resolution of one eighth, newest last; `most` is a full bar.
std::string sparkline(const std::deque<double>& values, double most);

/// Rates are over the interval since the last call.
class ReportView {
 public:
  /// `client` outlives this.
  explicit ReportView(Client& client) : client_(client), before_(client.statistics()) {}

  std::vector<std::string> table(const ReportSummary& summary);
  void printLine(const ReportSummary& summary);

 private:
  // Appends force and depth to the bars.
  void remember();
  std::string sensorName(int sensor) const;

  Client& client_;
  Statistics before_;
  std::deque<double> forces_N_;
  std::deque<double> depths_m_;
};

}  // namespace hapticd::apps

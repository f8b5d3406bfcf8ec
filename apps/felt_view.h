// What is felt now, for people who look: a table on a terminal, a line elsewhere.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "felt.h"

namespace hapticd::apps {

/// The newest values last, as bars of eighths in UTF-8; `most` is a full bar.
std::string sparkline(const std::deque<double>& values, double most);

/// Figures of the interval since the last call.
class FeltView {
 public:
  /// The client must live as long as this.
  explicit FeltView(Client& client) : client_(client), before_(client.statistics()) {}

  std::vector<std::string> table(const Felt& felt);
  void printLine(const Felt& felt);

 private:
  void remember();

  Client& client_;
  Statistics before_;
  std::deque<double> forces_N_;
  std::deque<double> depths_m_;
};

}  // namespace hapticd::apps

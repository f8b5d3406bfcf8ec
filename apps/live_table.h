// What changes while one looks at it: a progress bar and a table that are redrawn in place on a terminal, and
// are plain lines now and then everywhere else.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace hapticd::apps {

/// Whether standard output is a terminal that understands cursor movements.
bool onTerminal();

/// "1.8 MB" and the like.
std::string bytesText(double bytes);

/// A bar on a terminal, a line for each 10 % elsewhere.
class ProgressBar {
 public:
  explicit ProgressBar(std::string title) : title_(std::move(title)) {}
  void show(std::uint64_t done, std::uint64_t total);
  /// Ends the line of the bar.
  void finish();

 private:
  std::string title_;
  int shown_percent_ = -1;
};

/// Lines that replace each other in place; for terminals only.
class LiveTable {
 public:
  void show(const std::vector<std::string>& lines);

 private:
  std::size_t height_ = 0;
};

}  // namespace hapticd::apps

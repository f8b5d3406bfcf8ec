// A progress bar and a table that are redrawn in place on a terminal; elsewhere the progress bar prints plain
// lines.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace hapticd::apps {

/// Whether standard output is a terminal that supports cursor movement.
bool onTerminal();

/// A size for people, e.g. "1.8 MB".
std::string bytesText(double bytes);

/// A bar on a terminal, a line for each 10 % elsewhere.
class ProgressBar {
 public:
  explicit ProgressBar(std::string title) : title_(std::move(title)) {}
  void show(std::uint64_t done, std::uint64_t total);
  /// Ends the line of the bar on a terminal.
  void finish();

 private:
  std::string title_;
  int shownPercent_ = -1;
};

/// Lines that are redrawn in place; for terminals only.
class LiveTable {
 public:
  void show(const std::vector<std::string>& lines);
  /// Replaces the table by a line that stays; the next table comes below it.
  void say(const std::string& line);

 private:
  std::size_t height_ = 0;
};

}  // namespace hapticd::apps

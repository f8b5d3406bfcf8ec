// What a benchmark is, and what it gives back: rows of us against a yardstick that ran in the same minutes.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench/samples.h"

namespace hapticd::bench {

/// How long to measure.
enum class Length { windows, full, longest };

/// A figure against its goal.
struct Check {
  std::string what;  ///< "p50 ratio", "ticks/s"
  double value = 0;
  double limit = 0;
  bool atLeast = false;  ///< the limit is a floor
  /// Empty, or why this machine cannot say.
  std::string notMeasurable{};

  bool met() const noexcept { return atLeast ? value >= limit : value <= limit; }
};

/// One line of a table.
struct Row {
  std::string what;
  std::string unit = "us";
  Summary ours{};
  std::optional<Summary> yardstick{};
  std::vector<Check> checks{};  ///< empty: for information
  std::string note{};

  /// Ours to the yardstick's median (means when `byMean`).
  double ratio(bool byMean = false) const noexcept;
};

/// A histogram to be drawn: series over one axis.
struct Figure {
  struct Series {
    std::string label;
    Samples samples;
  };
  std::string file;  ///< without directory and ending
  std::string title;
  std::string unit = "us";
  double from = 0;
  double to = 0;
  std::vector<Series> series;
};

struct Outcome {
  std::vector<Row> rows;
  std::vector<Figure> figures;
  std::vector<std::string> remarks;
};

/// One run of the suite: how long, and where to say what is going on.
struct Run {
  Length length = Length::windows;
  std::function<void(const std::string&)> progress;

  double seconds(double windows, double full, double longest) const noexcept {
    return length == Length::windows ? windows : length == Length::full ? full : longest;
  }
};

struct Benchmark {
  std::string name;
  std::string what;
  std::string yardstick;
  std::function<Outcome(const Run&)> measure;
};

/// All of them, in the order they run.
const std::vector<Benchmark>& benchmarks();

}  // namespace hapticd::bench

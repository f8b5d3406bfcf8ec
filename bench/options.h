// The options of the benchmark suite. `hapticd bench` declares them, too, so that man page, completion and
// error texts know them, and hands them on.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace hapticd::bench {

inline constexpr const char* kSummary = "Measure how fast hapticd is, against yardsticks on this machine";

struct Options {
  std::vector<std::string> names;
  bool full = false;
  bool longest = false;
  bool list = false;
  bool json = false;
  std::string out;
};

/// `options` must live as long as `app`.
inline void declare(CLI::App& app, Options& options) {
  app.add_option("names", options.names, "Benchmarks to run [all of them]");
  CLI::Option* const list = app.add_flag("--list", options.list, "List the benchmarks and exit");
  app.add_flag("--json", options.json, "With --list: as JSON")->needs(list);
  app.add_flag("--full", options.full,
               "Longer measurements, about 25 minutes in all [windows of some seconds]");
  app.add_flag("--long", options.longest, "The longest measurements, about an hour");
  app.add_option("--out", options.out, "Directory for results.json, results.csv, results.md and drawings");
  app.footer(
      "Ratios decide; microseconds are for reference, because they differ between machines.\n"
      "Stop other work first; 'hapticd doctor' explains how to get realtime rights.\n"
      "Examples:\n"
      "  hapticd bench                     all of them, in under ten minutes\n"
      "  hapticd bench tick deform         two of them\n"
      "  hapticd bench --full --out out/   results to keep");
}

}  // namespace hapticd::bench

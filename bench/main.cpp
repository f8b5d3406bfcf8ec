// hapticd-bench: measures hapticd against yardsticks in the same minutes. `hapticd bench` runs it.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "bench/helpers.h"
#include "bench/options.h"
#include "bench/report.h"

namespace hapticd::bench {
namespace {

std::vector<const Benchmark*> chosen(const std::vector<std::string>& names) {
  std::vector<const Benchmark*> result;
  for (const Benchmark& benchmark : benchmarks()) {
    const bool named = std::find(names.begin(), names.end(), benchmark.name) != names.end();
    if (names.empty() || named) result.push_back(&benchmark);
  }
  for (const std::string& name : names) {
    const auto same = [&](const Benchmark* b) { return b->name == name; };
    if (std::none_of(result.begin(), result.end(), same))
      throw std::invalid_argument("there is no benchmark '" + name + "'; hapticd bench --list names them");
  }
  return result;
}

// Before the measurement, which may take an hour.
void requireFolder(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory / "figures", error);
  if (!error && ::access(directory.c_str(), W_OK | X_OK) != 0) error = {errno, std::generic_category()};
  if (error)
    throw std::runtime_error("cannot write to '" + directory.string() + "': " + error.message() +
                             "; name a folder that can be written");
}

// After the last line: a list that is cut, or results that nobody could read, are no success.
int printed() {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return 0;
  throw std::runtime_error("cannot write to standard output: the disk is full, or its reader has gone");
}

void write(const std::filesystem::path& directory, const std::vector<Measured>& all, Length length) {
  const auto machine = describeMachine(length);
  writeJson(directory / "results.json", all, machine);
  writeCsv(directory / "results.csv", all);
  writeFigures(directory, all);
  writeFile(directory / "results.md", asMarkdown(all, machine));
}

int run(const Options& options) {
  if (options.list && options.json) {
    nlohmann::json list = nlohmann::json::array();
    for (const Benchmark& b : benchmarks()) list.push_back({{"name", b.name}, {"what", b.what}});
    std::printf("%s\n", list.dump().c_str());
    return printed();
  }
  if (options.list) {
    for (const Benchmark& b : benchmarks()) std::printf("%-12s %s\n", b.name.c_str(), b.what.c_str());
    return printed();
  }
  const std::vector<const Benchmark*> toRun = chosen(options.names);
  if (!options.out.empty()) requireFolder(options.out);
  Run run;
  run.length = options.longest ? Length::longest : options.full ? Length::full : Length::windows;
  for (const std::string& line : describeMachine(run.length)) std::printf("%s\n", line.c_str());
  std::vector<Measured> all;
  int status = 0;
  for (const Benchmark* benchmark : toRun) {
    run.progress = [&](const std::string& text) {
      std::fprintf(stderr, "[%s] %s\n", benchmark->name.c_str(), text.c_str());
    };
    const auto begin = std::chrono::steady_clock::now();
    Measured measured{benchmark, {}, 0};
    try {
      measured.outcome = benchmark->measure(run);
    } catch (const std::exception& error) {
      // One failed benchmark does not stop the others.
      status = 1;
      measured.outcome.remarks.push_back(std::string("NOT MEASURED: ") + error.what());
    }
    measured.took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    std::printf("\n%s  (took %.0f s)\n", asText(measured).c_str(), measured.took_s);
    std::fflush(stdout);
    all.push_back(std::move(measured));
    // After each, so that an interrupted run leaves what it has.
    if (!options.out.empty()) write(options.out, all, run.length);
  }
  return std::max(status, printed());
}

}  // namespace
}  // namespace hapticd::bench

int main(int argc, char** argv) {
  using namespace hapticd::bench;
  CLI::App app{kSummary, "hapticd bench"};
  Options options;
  declare(app, options);
  std::vector<std::string> helper;
  app.add_option("--helper", helper, "A process that the suite starts for itself")->group("");
  try {
    try {
      app.parse(argc, argv);
    } catch (const CLI::Success& help) {
      app.exit(help);
      return printed();
    }
    return helper.empty() ? run(options) : runHelper(helper);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "hapticd bench: %s; 'hapticd bench --help' lists the options\n", error.what());
    return 2;
  } catch (const std::invalid_argument& error) {
    std::fprintf(stderr, "hapticd bench: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "hapticd bench: %s\n", error.what());
    return 1;
  }
}

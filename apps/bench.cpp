// hapticd bench: how fast it is, against yardsticks of the same minutes.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "bench/helpers.h"
#include "bench/report.h"
#include "commands.h"

namespace hapticd::apps {
namespace {

using bench::Benchmark;
using bench::Measured;

struct Options {
  std::vector<std::string> names;
  bool full = false;
  bool longest = false;
  bool list = false;
  std::string out;
  std::vector<std::string> helper;
};

std::vector<const Benchmark*> chosen(const std::vector<std::string>& names) {
  std::vector<const Benchmark*> result;
  for (const Benchmark& benchmark : bench::benchmarks()) {
    const bool named = std::find(names.begin(), names.end(), benchmark.name) != names.end();
    if (names.empty() || named) result.push_back(&benchmark);
  }
  for (const std::string& name : names) {
    const auto same = [&](const Benchmark* b) { return b->name == name; };
    if (std::none_of(result.begin(), result.end(), same))
      throw std::runtime_error("there is no benchmark '" + name + "'; hapticd bench --list names them");
  }
  return result;
}

void write(const std::filesystem::path& directory, const std::vector<Measured>& all, bench::Length length) {
  std::filesystem::create_directories(directory);
  const auto machine = bench::describeMachine(length);
  bench::writeJson(directory / "results.json", all, machine);
  bench::writeCsv(directory / "results.csv", all);
  bench::writePictures(directory, all);
  bench::writeFile(directory / "results.md", bench::asMarkdown(all, machine));
}

int run(const Options& options) {
  if (!options.helper.empty()) return bench::runHelper(options.helper);
  if (options.list) {
    for (const Benchmark& b : bench::benchmarks()) std::printf("%-12s %s\n", b.name.c_str(), b.what.c_str());
    return 0;
  }
  bench::Run run;
  run.length = options.longest ? bench::Length::longest
               : options.full  ? bench::Length::full
                               : bench::Length::windows;
  for (const std::string& line : bench::describeMachine(run.length)) std::printf("%s\n", line.c_str());
  std::vector<Measured> all;
  for (const Benchmark* benchmark : chosen(options.names)) {
    run.progress = [&](const std::string& text) {
      std::fprintf(stderr, "[%s] %s\n", benchmark->name.c_str(), text.c_str());
    };
    const auto begin = std::chrono::steady_clock::now();
    Measured measured{benchmark, {}, 0};
    try {
      measured.outcome = benchmark->measure(run);
    } catch (const std::exception& error) {
      // The others have nothing to do with it.
      measured.outcome.remarks.push_back(std::string("NOT MEASURED: ") + error.what());
    }
    measured.took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    std::printf("\n%s  (took %.0f s)\n", bench::asText(measured).c_str(), measured.took_s);
    std::fflush(stdout);
    all.push_back(std::move(measured));
    // After each, so that an interrupted run leaves what it has.
    if (!options.out.empty()) write(options.out, all, run.length);
  }
  return 0;
}

}  // namespace

void addBench(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("bench", "Measure how fast it is, against yardsticks on this machine");
  command->add_option("names", options->names, "Benchmarks to run [all of them]");
  command->add_flag("--list", options->list, "Name the benchmarks and end");
  command->add_flag("--full", options->full,
                    "Longer measurements, about 25 minutes in all [windows of some seconds]");
  command->add_flag("--long", options->longest, "The longest measurements, about an hour");
  command->add_option("--out", options->out,
                      "Directory for results.json, results.csv, results.md and drawings");
  command->add_option("--helper", options->helper, "A process that the suite starts for itself")->group("");
  command->footer(
      "Ratios decide, microseconds are for reference: another machine has others.\n"
      "Stop other work first; 'hapticd doctor' tells how to get realtime rights.\n"
      "Examples:\n"
      "  hapticd bench                     all of them, in under ten minutes\n"
      "  hapticd bench tick deform         two of them\n"
      "  hapticd bench --full --out out/   for keeping");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps

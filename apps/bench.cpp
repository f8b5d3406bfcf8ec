// hapticd bench: runs hapticd-bench, the benchmark suite, which is a program of its own.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "commands.h"

namespace hapticd::apps {
namespace {

struct BenchOptions {
  std::vector<std::string> names;
  bool list = false;
  bool json = false;
  bool full = false;
  bool longest = false;
  std::string out;
};

std::vector<std::string> argumentsOf(const BenchOptions& options) {
  std::vector<std::string> arguments;
  if (options.list) arguments.emplace_back("--list");
  if (options.json) arguments.emplace_back("--json");
  if (options.full) arguments.emplace_back("--full");
  if (options.longest) arguments.emplace_back("--long");
  if (!options.out.empty()) arguments.push_back("--out=" + options.out);
  if (!options.names.empty()) arguments.emplace_back("--");
  arguments.insert(arguments.end(), options.names.begin(), options.names.end());
  return arguments;
}

/// Replaces this process; returns only by throwing.
[[noreturn]] void runSuite(std::vector<std::string> arguments) {
  const std::filesystem::path suite =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "hapticd-bench";
  arguments.insert(arguments.begin(), suite.string());
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  execv(suite.c_str(), argv.data());
  throw std::runtime_error("cannot run the benchmark suite " + suite.string() + ": " + std::strerror(errno) +
                           "; build the target hapticd-bench, or install hapticd with it");
}

}  // namespace

// The same options as in bench/main.cpp, so that man page, completion and error texts know them; a test
// compares the two.
void addBench(CLI::App& app) {
  auto options = std::make_shared<BenchOptions>();
  CLI::App* command =
      app.add_subcommand("bench", "Measure how fast hapticd is, against yardsticks on this machine");
  command->add_option("names", options->names, "Benchmarks to run [all of them]");
  CLI::Option* const list = command->add_flag("--list", options->list, "List the benchmarks and exit");
  command->add_flag("--json", options->json, "With --list: as JSON")->needs(list);
  command->add_flag("--full", options->full,
                    "Longer measurements, about 25 minutes in all [windows of some seconds]");
  command->add_flag("--long", options->longest, "The longest measurements, about an hour");
  command->add_option("--out", options->out,
                      "Directory for results.json, results.csv, results.md and drawings");
  command->footer(
      "Ratios decide; microseconds are for reference, because they differ between machines.\n"
      "Stop other work first; 'hapticd doctor' explains how to get realtime rights.\n"
      "Examples:\n"
      "  hapticd bench                     all of them, in under ten minutes\n"
      "  hapticd bench tick deform         two of them\n"
      "  hapticd bench --full --out out/   results to keep");
  command->callback([options] { runSuite(argumentsOf(*options)); });
}

}  // namespace hapticd::apps

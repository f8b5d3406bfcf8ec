// hapticd bench: runs hapticd-bench, the benchmark suite, which is a program of its own.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/options.h"
#include "commands.h"

namespace hapticd::apps {
namespace {

// What was typed, as words.
std::vector<std::string> argumentsOf(const CLI::App& command) {
  std::vector<std::string> arguments;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& value : option->results()) {
      if (!option->get_positional()) arguments.push_back(option->get_name());
      if (option->get_items_expected_max() > 0) arguments.push_back(value);
    }
  }
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

void addBench(CLI::App& app) {
  auto options = std::make_shared<bench::Options>();
  CLI::App* command = app.add_subcommand("bench", bench::kSummary);
  bench::declare(*command, *options);
  command->callback([command, options] { runSuite(argumentsOf(*command)); });
}

}  // namespace hapticd::apps

// hapticd bench: runs hapticd-bench, the benchmark suite, which is a program of its own.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "commands.h"

namespace hapticd::apps {
namespace {

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
  CLI::App* command =
      app.add_subcommand("bench", "Measure how fast it is, against yardsticks on this machine");
  // The suite reads all arguments itself, --help too.
  command->set_help_flag();
  command->prefix_command();
  command->footer("'hapticd bench --help' lists the options, 'hapticd bench --list' the benchmarks.");
  command->callback([command] { runSuite(command->remaining()); });
}

}  // namespace hapticd::apps

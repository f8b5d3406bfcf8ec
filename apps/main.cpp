// hapticd: a haptics server that speaks VRPN, and the tools around it.
#include <fcntl.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/nearest_name.h"
#include "commands.h"
#include "server/config/config.h"
#include "version.h"

namespace {

// " did you mean 'NAME'?", or nothing.
std::string suggestion(const std::string& typed, const std::vector<std::string>& names) {
  const std::optional<std::string> nearest = hapticd::base::nearestName(typed, names);
  return nearest ? " did you mean '" + *nearest + "'?" : "";
}

std::vector<std::string> commandNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command :
       app.get_subcommands([](const CLI::App* each) { return !each->get_group().empty(); }))
    names.push_back(command->get_name());
  return names;
}

// The innermost command that was typed, and its name.
std::pair<const CLI::App*, std::string> typedCommand(const CLI::App& app) {
  const CLI::App* command = &app;
  std::string name = "hapticd";
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    name += ' ' + command->get_name();
  }
  return {command, name};
}

// Names the option that was typed wrong, of the innermost command. False when there was none.
bool explainUnknownOption(const CLI::App& app) {
  const auto [command, name] = typedCommand(app);
  const std::vector<std::string> rest = app.remaining(true);
  const auto typed =
      std::find_if(rest.begin(), rest.end(), [](const std::string& text) { return text.starts_with("-"); });
  if (typed == rest.end()) return false;
  std::vector<std::string> names;
  for (const CLI::Option* option : command->get_options()) {
    for (const std::string& each : option->get_lnames()) names.push_back("--" + each);
  }
  const std::string option = typed->substr(0, typed->find('='));
  std::fprintf(stderr, "%s: unknown option '%s';%s '%s --help' lists the options\n", name.c_str(),
               option.c_str(), suggestion(option, names).c_str(), name.c_str());
  return true;
}

// Names the command that does not exist. False when none was typed.
bool explainUnknownCommand(const CLI::App& app) {
  const std::vector<std::string> rest = app.remaining();
  if (!app.get_subcommands().empty() || rest.empty() || rest[0].starts_with("-")) return false;
  std::fprintf(stderr, "hapticd: unknown command '%s';%s 'hapticd --help' lists the commands\n",
               rest[0].c_str(), suggestion(rest[0], commandNames(app)).c_str());
  return true;
}

// False when a command was typed.
bool explainMissingCommand(const CLI::App& app, const CLI::ParseError& error) {
  const auto code = static_cast<CLI::ExitCodes>(error.get_exit_code());
  if (code != CLI::ExitCodes::RequiredError || !app.get_subcommands().empty()) return false;
  std::fprintf(stderr, "hapticd: a command is required; 'hapticd --help' lists the commands\n");
  return true;
}

// How CLI11's text on a flag with a value ends; it begins with the name, without hyphens.
constexpr std::string_view kFlagWithValue = " was given a disallowed flag override";

// CLI11's own texts name neither the command nor, for some errors, what to do.
std::string textOf(const CLI::App& app, const CLI::ParseError& error) {
  const std::string text = error.what();
  const auto code = static_cast<CLI::ExitCodes>(error.get_exit_code());
  if (code == CLI::ExitCodes::ExtrasError) {
    const std::string extra = app.remaining(true).front();
    const bool isConfig = typedCommand(app).first->get_option_no_throw("--config") != nullptr &&
                          (extra.ends_with(".cfg") || extra.ends_with(".toml"));
    return "unexpected argument '" + extra + "'" + (isConfig ? "; use '--config " + extra + "'" : "");
  }
  if (code != CLI::ExitCodes::ArgumentMismatch) return text;
  if (text.ends_with(kFlagWithValue))
    return "--" + text.substr(0, text.size() - kFlagWithValue.size()) + " takes no value";
  const std::string option = text.substr(0, text.find(':'));
  return option + (text.ends_with("missing") ? " needs a value" : " is given more than once");
}

// The exit status after an error on the command line, which it prints, or after --help and --version.
int explain(const CLI::App& app, const CLI::ParseError& error) {
  if (explainUnknownCommand(app)) return 2;
  if (error.get_exit_code() == 0) return app.exit(error);
  if (explainUnknownOption(app) || explainMissingCommand(app, error)) return 2;
  const std::string name = typedCommand(app).second;
  std::fprintf(stderr, "%s: %s; '%s --help' lists the options\n", name.c_str(), textOf(app, error).c_str(),
               name.c_str());
  return 2;
}

// The next file or socket would take the number of a standard stream that is closed, and its messages. What
// is printed to a closed standard output fails, as on a full disk.
void openStandardStreams() {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    const int mode = fd == STDERR_FILENO ? O_RDWR : O_RDONLY;
    if (::fcntl(fd, F_GETFD) < 0) static_cast<void>(::open("/dev/null", mode));
  }
}

// 'ulimit -s' is the stack of each thread, too: the servo loop, which uses more than a small one has, would
// crash. 8 MB are the default of Linux.
void giveThreadsStack() {
  constexpr std::size_t kStack_bytes = 8U << 20U;
  rlimit limit{};
  if (getrlimit(RLIMIT_STACK, &limit) == 0 && limit.rlim_cur < kStack_bytes) {
    limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, kStack_bytes);
    setrlimit(RLIMIT_STACK, &limit);  // of the main thread
  }
  pthread_attr_t attributes;
  if (pthread_getattr_default_np(&attributes) != 0) return;
  std::size_t given = 0;
  if (pthread_attr_getstacksize(&attributes, &given) == 0 && given < kStack_bytes &&
      pthread_attr_setstacksize(&attributes, kStack_bytes) == 0)
    pthread_setattr_default_np(&attributes);
  pthread_attr_destroy(&attributes);
}

// Otherwise "--force=no" and "--full=3" would be taken, and the value of some ignored.
void refuseValuesOfFlags(CLI::App& app) {
  for (CLI::Option* option : app.get_options([](const CLI::Option*) { return true; }))
    if (option->get_items_expected_max() == 0) option->disable_flag_override();
  for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    refuseValuesOfFlags(*command);
}

// The words in the order in which CLI11 takes them: the last first. "help COMMAND" is "COMMAND --help".
std::vector<std::string> wordsOf(int argc, char** argv) {
  std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
  if (!words.empty() && words[0] == "help") {
    words.erase(words.begin());
    words.emplace_back("--help");
  }
  std::reverse(words.begin(), words.end());
  return words;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace hapticd::apps;
  openStandardStreams();
  giveThreadsStack();
  CLI::App app{
      "hapticd: a haptics server that speaks VRPN.\n"
      "One process owns a haptic device, takes a scene from any VRPN client, renders forces at 1 kHz\n"
      "and reports pose, contact and force to all clients.\n\n"
      "A first touch, without hardware:\n"
      "  hapticd demo\n"
      "The same in two terminals, with a mesh of your own:\n"
      "  hapticd serve\n"
      "  hapticd touch bunny.obj --server Phantom@localhost"};
  app.name("hapticd");
  app.set_version_flag("--version", versionText());
  app.require_subcommand(1);
  addDemo(app);
  addServe(app);
  addTouch(app);
  addWatch(app);
  addStop(app);
  addTunnel(app);
  addMark(app);
  addRecord(app);
  addExport(app);
  addInfo(app);
  addPlot(app);
  addRender(app);
  addReplay(app);
  addDoctor(app);
  addDevices(app);
  addList(app);
  addSelfTest(app);
  addBench(app);
  addManual(app);
  addDeviceHost(app);
  refuseValuesOfFlags(app);
  try {
    app.parse(wordsOf(argc, argv));
  } catch (const CLI::ParseError& error) {
    exitCode = explain(app, error);
  } catch (const hapticd::server::ConfigError& error) {
    std::fprintf(stderr, "hapticd: %s\n", error.what());
    return 2;
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "hapticd: out of memory\n");
    return 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "hapticd: %s\n", error.what());
    return 1;
  }
  // What did not reach a full disk must not look like a success.
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    std::fprintf(stderr, "hapticd: %s\n", kNotWritten);
    return exitCode == 0 ? 1 : exitCode;
  }
  return exitCode;
}

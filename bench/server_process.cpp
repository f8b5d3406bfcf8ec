#include "bench/server_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "bench/scenes.h"

namespace hapticd::bench {
namespace {

using namespace std::chrono_literals;

std::string contentsOf(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

int codeOf(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace

std::string hapticdProgram() {
  return std::filesystem::read_symlink("/proc/self/exe").replace_filename("hapticd").string();
}

ChildProcess::ChildProcess(const std::vector<std::string>& arguments, std::filesystem::path log)
    : log_(std::move(log)) {
  start("/proc/self/exe", arguments);
}

ChildProcess::ChildProcess(const std::string& program, const std::vector<std::string>& arguments,
                           std::filesystem::path log)
    : log_(std::move(log)) {
  start(program, arguments);
}

void ChildProcess::start(const std::string& program, const std::vector<std::string>& arguments) {
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  const int failed = posix_spawnp(&pid_, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) throw std::system_error(failed, std::generic_category(), "cannot start " + program);
}

ChildProcess::~ChildProcess() {
  if (pid_ <= 0) return;
  signal(SIGCONT);
  signal(SIGKILL);
  wait();
}

void ChildProcess::signal(int number) const noexcept {
  if (pid_ > 0) ::kill(pid_, number);
}

int ChildProcess::wait() {
  if (pid_ <= 0) return -1;
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  return codeOf(status);
}

int ChildProcess::stop() {
  signal(SIGCONT);
  signal(SIGTERM);
  for (int i = 0; i < 200 && pid_ > 0; ++i) {
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = -1;
      return codeOf(status);
    }
    std::this_thread::sleep_for(25ms);
  }
  signal(SIGKILL);
  return wait();
}

std::string ChildProcess::output() const {
  return contentsOf(log_);
}

WorkDirectory::WorkDirectory() {
  std::string pattern = (std::filesystem::temp_directory_path() / "hapticd_bench_XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr)
    throw std::system_error(errno, std::generic_category(), "cannot make a directory " + pattern);
  path_ = pattern;
}

WorkDirectory::~WorkDirectory() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::vector<std::string> ServerProcess::arguments(const WorkDirectory& work, const std::string& hand,
                                                  const std::vector<std::string>& more) {
  const std::filesystem::path file = work / "hand.csv";
  // By default the hand rests outside of every benchmark's scene.
  std::ofstream(file) << (hand.empty() ? "t_s,x_m,y_m,z_m\n0,0,0.055,0\n" : hand);
  std::vector<std::string> all{"serve", "--listen", "127.0.0.1:0", "--allow-no-rt", "--hand", file.string()};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

ServerProcess::ServerProcess(const std::string& hand, const std::vector<std::string>& more)
    : process_(hapticdProgram(), arguments(work_, hand, more), work_ / "log") {
  static const std::regex listening(R"(listening on [0-9.]+:([0-9]+))");
  for (int i = 0; i < 400; ++i) {
    const std::string log = process_.output();
    std::smatch found;
    if (std::regex_search(log, found, listening)) {
      port_ = static_cast<std::uint16_t>(std::stoi(found[1]));
      return;
    }
    std::this_thread::sleep_for(25ms);
  }
  throw std::runtime_error("the server did not start: " + process_.output());
}

std::string ServerProcess::device() const {
  return "Phantom@tcp://127.0.0.1:" + std::to_string(port_);
}

double ServerProcess::residentBytes() const {
  std::ifstream status("/proc/" + std::to_string(process_.id()) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) return 1024 * std::stod(line.substr(6));
  }
  throw std::runtime_error("the server has ended: " + process_.output());
}

std::string handFile(double seconds, int act) {
  std::string text = "t_s,x_m,y_m,z_m\n";
  const auto rows = static_cast<int>(seconds * 1000);
  for (int i = 0; i < rows; ++i) {
    const Vec3 p = handAt(static_cast<Act>(act), i * 1e-3);
    std::array<char, 128> line{};
    std::snprintf(line.data(), line.size(), "%.3f,%.9f,%.9f,%.9f\n", i * 1e-3, p.x(), p.y(), p.z());
    text += line.data();
  }
  return text;
}

void raiseDescriptorLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace hapticd::bench

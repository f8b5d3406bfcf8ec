#include "device/whole_server/served_device.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <new>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <thread>

extern char** environ;

namespace hapticd::whole_server {
namespace {

constexpr auto kLongest = 120s;

std::string readAll(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

std::vector<char*> pointers(const std::vector<std::string>& words) {
  std::vector<char*> all;
  for (const std::string& word : words) all.push_back(const_cast<char*>(word.c_str()));
  all.push_back(nullptr);
  return all;
}

}  // namespace

WorkDirectory::WorkDirectory() {
  std::string name = (std::filesystem::temp_directory_path() / "hapticd_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("mkdtemp: " + name);
  path_ = name;
}

WorkDirectory::~WorkDirectory() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

SharedArm::SharedArm(const std::string& file) {
  const int descriptor = open(file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (descriptor < 0 || ftruncate(descriptor, sizeof(mock::ArmBlock)) != 0) throw std::runtime_error(file);
  void* memory = mmap(nullptr, sizeof(mock::ArmBlock), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  close(descriptor);
  if (memory == MAP_FAILED) throw std::runtime_error(file);
  block_ = new (memory) mock::ArmBlock;
}

SharedArm::~SharedArm() {
  munmap(block_, sizeof(mock::ArmBlock));
}

Vec3 SharedArm::force(std::int64_t tick) const {
  const mock::ArmTick& entry = at(tick);
  return {entry.force_N[0], entry.force_N[1], entry.force_N[2]};
}

bool eventually(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + kLongest;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

ServerProcess::ServerProcess(const WorkDirectory& work, const std::vector<std::string>& arguments,
                             const std::vector<std::string>& environment, int output)
    : log_(work.file("log")) {
  std::vector<std::string> words{HAPTICD, "serve", "--listen", "127.0.0.1:0", "--allow-no-rt"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  // The destructor kills the server, which then leaves its socket.
  std::vector<std::string> settings{"XDG_STATE_HOME=" + work.file("state"),
                                    "XDG_RUNTIME_DIR=" + work.file("")};
  settings.insert(settings.end(), environment.begin(), environment.end());
  for (char** setting = environ; *setting != nullptr; ++setting) {
    const std::string_view text = *setting;
    const auto is = [&](const char* name) { return text.starts_with(name); };
    if (!is("XDG_STATE_HOME=") && !is("XDG_RUNTIME_DIR=") && !is("RUNTIME_DIRECTORY="))
      settings.emplace_back(text);
  }
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  if (output >= 0) {
    posix_spawn_file_actions_adddup2(&files, output, STDOUT_FILENO);
  } else {
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log_.c_str(), O_WRONLY | O_CREAT | O_APPEND,
                                     0600);
  }
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  const int error =
      posix_spawn(&id_, HAPTICD, &files, nullptr, pointers(words).data(), pointers(settings).data());
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) throw std::runtime_error(std::string(HAPTICD ": ") + std::strerror(error));
}

ServerProcess::~ServerProcess() {
  if (id_ < 0) return;
  kill(id_, SIGKILL);
  waitpid(id_, nullptr, 0);
}

std::string ServerProcess::address() {
  static const std::regex pattern("listening on ([0-9.]+:[0-9]+)");
  std::smatch found;
  std::string text;
  eventually([&] {
    text = readAll(log_);
    return std::regex_search(text, found, pattern) || waitpid(id_, nullptr, WNOHANG) == id_;
  });
  if (!found.empty()) return found[1];
  id_ = -1;
  return {};
}

std::string ServerProcess::log() const {
  return readAll(log_);
}

void ServerProcess::signal(int number) const {
  if (id_ > 0) kill(id_, number);
}

int ServerProcess::end() {
  int status = -1;
  if (id_ < 0 || !eventually([&] { return waitpid(id_, &status, WNOHANG) == id_; })) return -1;
  id_ = -1;
  return status;
}

Visitor::Visitor(const std::string& address)
    : client_("Phantom@tcp://" + address, {.connectTimeout = 60s, .reconnect = false}) {
  client_.onText([this](const TextReport& report) { texts_.push_back(report.text); });
}

bool Visitor::until(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + kLongest;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    client_.poll(1ms);
  }
  return true;
}

bool Visitor::heard(const std::string& words) const {
  return texts().find(words) != std::string::npos;
}

std::string Visitor::texts() const {
  std::string all;
  for (const std::string& text : texts_) all += text + "\n";
  return all;
}

bool Visitor::untilReady() {
  return until([this] {
    const GuardReport& guard = client_.latest().guard;
    if (!guard.latched.empty()) {
      client_.rearmForces();
      client_.runFor(50ms);
    }
    return guard.armed && !guard.stopped && guard.latched.empty();
  });
}

}  // namespace hapticd::whole_server

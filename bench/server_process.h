// A real server in its own process, on a free port, with the simulated hand.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace hapticd::bench {

/// The program `hapticd`, which lies beside this one.
std::string hapticdProgram();

/// A child process; its destructor kills it.
class ChildProcess {
 public:
  /// Runs this same program with these arguments and writes its output to `log`. Throws std::system_error.
  ChildProcess(const std::vector<std::string>& arguments, std::filesystem::path log);
  /// Runs another program: a path, or a name that is looked up in PATH.
  ChildProcess(const std::string& program, const std::vector<std::string>& arguments,
               std::filesystem::path log);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t id() const noexcept { return pid_; }
  void signal(int number) const noexcept;
  /// Sends SIGTERM and waits for the end; returns the exit code, or -1.
  int stop();
  /// Waits for the end; returns the exit code, or -1.
  int wait();
  std::string output() const;

 private:
  void start(const std::string& program, const std::vector<std::string>& arguments);

  pid_t pid_ = -1;
  std::filesystem::path log_;
};

/// A temporary directory for the files of a benchmark; its destructor deletes it.
class WorkDirectory {
 public:
  WorkDirectory();
  ~WorkDirectory();
  WorkDirectory(const WorkDirectory&) = delete;
  WorkDirectory& operator=(const WorkDirectory&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// `hapticd serve` with the simulated hand, ready for clients.
class ServerProcess {
 public:
  /// `hand` is the text of a CSV file as serve reads it, empty for a resting hand. Appends `more` to the
  /// arguments of serve. Throws std::runtime_error with the server's output when it does not start.
  explicit ServerProcess(const std::string& hand = "", const std::vector<std::string>& more = {});

  std::uint16_t port() const noexcept { return port_; }
  /// NAME@tcp://HOST:PORT for a client.
  std::string device() const;
  const ChildProcess& process() const noexcept { return process_; }
  ChildProcess& process() noexcept { return process_; }
  /// Resident memory of the process, from /proc.
  double residentBytes() const;

 private:
  static std::vector<std::string> arguments(const WorkDirectory& work, const std::string& hand,
                                            const std::vector<std::string>& more);

  WorkDirectory work_;
  ChildProcess process_;
  std::uint16_t port_ = 0;
};

/// The text of a hand file for ServerProcess: one row for each millisecond of bench::handAt().
std::string handFile(double seconds, int act);

/// Raises the limit of open files of this process and its children as far as the system allows.
void raiseDescriptorLimit();

}  // namespace hapticd::bench

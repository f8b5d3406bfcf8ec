// A real server in a process of its own: this same binary, on a port of its own, with the simulated hand.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace hapticd::bench {

/// A child process; killed when this goes.
class ChildProcess {
 public:
  /// Runs this same program with these arguments, its output into `log`. Throws std::runtime_error.
  ChildProcess(const std::vector<std::string>& arguments, std::filesystem::path log);
  /// Runs another program, found in PATH.
  ChildProcess(const std::string& program, const std::vector<std::string>& arguments,
               std::filesystem::path log);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t id() const noexcept { return pid_; }
  void signal(int number) const noexcept;
  /// Asks it to end and waits; what it returned, or -1.
  int stop();
  /// Waits until it ends by itself.
  int wait();
  std::string output() const;

 private:
  void start(const std::string& program, const std::vector<std::string>& arguments);

  pid_t pid_ = -1;
  std::filesystem::path log_;
};

/// A directory for the files of a benchmark, gone with it.
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
  /// `hand` is a CSV file as serve takes it, empty for a resting hand. More arguments go to serve as they
  /// are. Throws std::runtime_error with the server's own words when it does not come up.
  explicit ServerProcess(const std::string& hand = "", const std::vector<std::string>& more = {});

  std::uint16_t port() const noexcept { return port_; }
  /// NAME@tcp://HOST:PORT for a client.
  std::string device() const;
  const ChildProcess& process() const noexcept { return process_; }
  ChildProcess& process() noexcept { return process_; }
  /// Bytes of memory that are in use by the process, from /proc.
  double residentBytes() const;

 private:
  static std::vector<std::string> arguments(const WorkDirectory& work, const std::string& hand,
                                            const std::vector<std::string>& more);

  WorkDirectory work_;
  ChildProcess process_;
  std::uint16_t port_ = 0;
};

/// A hand file: one row for each millisecond of bench::handAt(), for ServerProcess.
std::string handFile(double seconds, int act);

/// This program may open this many sockets, and so may its children.
void raiseDescriptorLimit();

}  // namespace hapticd::bench

// A client in a separate process, which can be killed or suspended.
#pragma once

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

#include "net/endpoint.h"

namespace hapticd::test {

/// Construct it before any thread exists: it forks the process.
class ChildClient {
 public:
  /// `live` runs in the child with the server's endpoint until the process is killed.
  template <class Live>
  explicit ChildClient(const Live& live) {
    int ends[2];
    if (::pipe(ends) != 0 || (pid_ = ::fork()) < 0) throw std::runtime_error("cannot start a process");
    if (pid_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      ::close(ends[1]);
      net::Endpoint server;
      if (::read(ends[0], &server, sizeof server) == sizeof server) live(server);
      ::_exit(0);
    }
    ::close(ends[0]);
    pipe_ = ends[1];
  }
  ~ChildClient() {
    kill();
    ::close(pipe_);
  }
  ChildClient(const ChildClient&) = delete;
  ChildClient& operator=(const ChildClient&) = delete;

  /// Sends the endpoint of the server to the child, which then runs `live`.
  void connectTo(const net::Endpoint& server) {
    if (::write(pipe_, &server, sizeof server) != sizeof server) throw std::runtime_error("no child");
  }
  /// Suspends the process; its kernel keeps acknowledging data.
  void suspend() { ::kill(pid_, SIGSTOP); }
  /// Like kill -9. Returns when the process has ended.
  void kill() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_ = -1;
  int pipe_ = -1;
};

}  // namespace hapticd::test

// A client in a process of its own, which can be killed as the system kills.
#pragma once

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

#include "net/endpoint.h"

namespace hapticd::test {

/// Make it before anything that has threads: the process is forked.
class ChildClient {
 public:
  /// `live` gets the server's address in the child, connects, and goes on until the process is killed.
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

  /// Tells the child where the server is; it goes on from there.
  void connectTo(const net::Endpoint& server) {
    if (::write(pipe_, &server, sizeof server) != sizeof server) throw std::runtime_error("no child");
  }
  /// Its program stands still, its system does not.
  void suspend() { ::kill(pid_, SIGSTOP); }
  /// As kill -9. Returns when it is gone.
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

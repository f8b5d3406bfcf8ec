// hapticd as a lab runs it, in a process of its own, on a mock; and a client that talks to it over the
// network.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "device/whole_server/demo_scene.h"
#include "hapticd/client.h"
#include "mocks/arm_block.h"

namespace hapticd::whole_server {

using namespace std::chrono_literals;

/// A directory that goes with this.
class WorkDirectory {
 public:
  WorkDirectory();
  ~WorkDirectory();
  WorkDirectory(const WorkDirectory&) = delete;
  WorkDirectory& operator=(const WorkDirectory&) = delete;
  std::string file(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

/// The block of a mock, in a file that another process can map.
class SharedArm {
 public:
  explicit SharedArm(const std::string& file);
  ~SharedArm();
  SharedArm(const SharedArm&) = delete;
  SharedArm& operator=(const SharedArm&) = delete;
  mock::ArmBlock* operator->() const { return block_; }
  mock::ArmBlock& operator*() const { return *block_; }

  const mock::ArmTick& at(std::int64_t tick) const { return block_->log[tick % mock::kLogTicks]; }
  Vec3 force(std::int64_t tick) const;
  Vec3 left() const { return {block_->left_N[0], block_->left_N[1], block_->left_N[2]}; }

 private:
  mock::ArmBlock* block_ = nullptr;
};

/// Waits for something, for at most two minutes: a loaded machine under a sanitizer is slow, not wrong.
bool eventually(const std::function<bool()>& condition);

/// `hapticd serve` with these arguments and NAME=VALUE settings.
class ServerProcess {
 public:
  /// `output`: a descriptor for its output instead of the file of log().
  ServerProcess(const WorkDirectory& work, const std::vector<std::string>& arguments,
                const std::vector<std::string>& environment, int output = -1);
  ~ServerProcess();
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  /// HOST:PORT; empty when the server ended before it listened.
  std::string address();
  std::string log() const;
  pid_t id() const { return id_; }
  void signal(int number) const;
  /// Waits for the end; what waitpid() says, or -1 when it does not end.
  int end();

 private:
  pid_t id_ = -1;
  std::string log_;
};

/// A client of the server's device that keeps what it is told.
class Visitor {
 public:
  explicit Visitor(const std::string& address);
  Client& client() { return client_; }
  /// Talks until the condition holds; false after two minutes.
  bool until(const std::function<bool()>& condition);
  /// Whether a text with these words came.
  bool heard(const std::string& words) const;
  std::string texts() const;
  /// What was heard until now.
  void forget() { texts_.clear(); }
  bool latched() const { return !client_.latest().guard.latched.empty(); }
  /// Forces are armed, and nothing is latched; re-arms what a stalled machine has latched.
  bool untilReady();

 private:
  Client client_;
  std::vector<std::string> texts_;
};

}  // namespace hapticd::whole_server

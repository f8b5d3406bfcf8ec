// A logind that does what a test tells it.
#pragma once

#include <set>
#include <string>

#include "system_bus/scripted_service.h"

namespace hapticd::test {

class ScriptedLogind : public ScriptedService {
 public:
  /// `refused`: modes of locks that it does not give.
  explicit ScriptedLogind(std::set<std::string> refused = {});
  ~ScriptedLogind() override;

  /// Waits until just the locks of these modes are held; false after a time that only a hang can take.
  bool waitHeld(const std::set<std::string>& modes);
  /// Gives all locks from now on.
  void refuseNothing();
  /// Waits until it has refused so many requests; false as above.
  bool waitRefusals(int count);
  /// Tells all that the machine goes to sleep, or that it woke.
  void announceSleep(bool begins);
  /// What was asked for last: "sleep hapticd".
  std::string lastRequest();

 private:
  int answer(sd_bus_message* call) override;
  std::set<std::string> held();

  struct Lock {
    std::string mode;
    int fd;
  };
  std::set<std::string> refused_;
  std::vector<Lock> locks_;  // ends of pipes; of those that were given back, the other end is closed
  std::string lastRequest_;
  int refusals_ = 0;
};

}  // namespace hapticd::test

// What this program prints.
#pragma once

#include <map>
#include <string>

#include "participant.h"

namespace hapticd::apps::ros2 {

/// Prints a line. Any thread.
void log(const std::string& text);

/// Prints why samples of topics are ignored: one line for each run of the same reason.
class TopicLog {
 public:
  explicit TopicLog(const Participant& participant) : participant_(participant) {}

  void ignored(const std::string& topic, const std::string& reason);

 private:
  const Participant& participant_;
  std::map<std::string, std::string> last_;  // by topic
};

/// Why a sample in this frame cannot be used; empty for the frame `base` and for none.
std::string wrongFrame(const char* frame, const std::string& base);

}  // namespace hapticd::apps::ros2

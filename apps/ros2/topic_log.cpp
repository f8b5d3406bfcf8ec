#include "topic_log.h"

#include <cstdio>
#include <utility>

#include "base/printable.h"

namespace hapticd::apps::ros2 {

void log(const std::string& text) {
  std::printf("%s\n", ("hapticd-ros2: " + text).c_str());
  std::fflush(stdout);
}

void TopicLog::ignored(const std::string& topic, const std::string& reason) {
  if (std::exchange(last_[topic], reason) != reason)
    log(participant_.fullName(topic) + " is ignored: " + reason);
}

std::string wrongFrame(const char* frame, const std::string& base) {
  const std::string name = frame;
  if (name.empty() || name == base) return {};
  return "frame_id is '" + base::printable(name) + "'; transform the message into '" + base +
         "', or leave frame_id empty";
}

}  // namespace hapticd::apps::ros2

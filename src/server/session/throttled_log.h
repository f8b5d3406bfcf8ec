// Log lines that any stranger can cause: a few each second, then a count.
#pragma once

#include <spdlog/spdlog.h>

#include <string>

namespace hapticd::server {

/// One thread. reportSuppressed() is called once a second.
class ThrottledLog {
 public:
  void warn(const std::string& text) {
    if (++lines_ <= kLinesPerSecond) spdlog::warn("{}", text);
  }
  void reportSuppressed() {
    if (lines_ > kLinesPerSecond)
      spdlog::warn("{} more lines of this kind in the last second", lines_ - kLinesPerSecond);
    lines_ = 0;
  }

 private:
  static constexpr int kLinesPerSecond = 5;
  int lines_ = 0;
};

}  // namespace hapticd::server

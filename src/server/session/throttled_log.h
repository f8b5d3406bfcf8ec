// Rate-limited log for warnings that untrusted clients can cause.
#pragma once

#include <spdlog/spdlog.h>

#include <string>

namespace hapticd::server {

/// Logs up to five warnings per second and then only their number. One thread; call reportSuppressed() once
/// per second.
class ThrottledLog {
 public:
  void warn(const std::string& text) {
    if (++lines_ <= kLinesPerSecond) spdlog::warn("{}", text);
  }
  void reportSuppressed() {
    if (lines_ > kLinesPerSecond)
      spdlog::warn("{} more warnings about clients suppressed in the last second", lines_ - kLinesPerSecond);
    lines_ = 0;
  }

 private:
  static constexpr int kLinesPerSecond = 5;
  int lines_ = 0;
};

}  // namespace hapticd::server

// Rate-limited log for lines that untrusted clients can cause.
#pragma once

#include <spdlog/spdlog.h>

#include <cstdint>
#include <map>
#include <string>

namespace hapticd::server {

/// Logs up to kLinesPerSource lines per second and source, up to kLines of all sources, and up to a number of
/// bytes; of the others only the number. Addresses of this machine may cause kLocalLines besides. One thread;
/// call reportSuppressed() once per second.
class ThrottledLog {
 public:
  static constexpr int kLinesPerSource = 20;
  static constexpr int kLines = 60;
  static constexpr int kLocalLines = 1000;

  explicit ThrottledLog(std::size_t bytesPerSecond = SIZE_MAX) : most_(bytesPerSecond) {}

  /// `source` is what one client cannot change at will: its number or its address.
  void log(spdlog::level::level_enum level, const std::string& source, const std::string& text) {
    const bool local = source.starts_with("127.");
    const bool mayLog =
        ++bySource_[source] <= (local ? kLocalLines : kLinesPerSource) && (local || lines_ < kLines);
    if (mayLog && bytes_ + text.size() <= most_) {
      if (!local) ++lines_;
      bytes_ += text.size();
      spdlog::log(level, "{}", text);
    } else {
      ++suppressed_;
    }
  }
  /// A warning about a peer that is no client.
  void warn(const std::string& text) { log(spdlog::level::warn, {}, text); }
  /// The same, of what lasts while the peer tries again and again: at once, then once a minute with the
  /// number.
  void warnOfLasting(const std::string& cause) {
    const auto known = lasting_.find(cause);
    if (known != lasting_.end()) {
      ++known->second.times;
      return;
    }
    if (lasting_.size() < kLasting) lasting_.emplace(cause, Lasting{});
    warn(cause);
  }
  void reportSuppressed() {
    reportLasting();
    if (suppressed_ > 0)
      spdlog::warn("{} more lines about clients suppressed in the last second", suppressed_);
    bySource_.clear();
    lines_ = 0;
    bytes_ = 0;
    suppressed_ = 0;
  }

 private:
  static constexpr std::size_t kLasting = 1000;
  static constexpr int kMinute_s = 60;

  struct Lasting {
    int seconds = 0;
    std::uint64_t times = 0;
  };

  void reportLasting() {
    for (auto each = lasting_.begin(); each != lasting_.end();) {
      Lasting& lasting = each->second;
      if (++lasting.seconds < kMinute_s) {
        ++each;
      } else if (lasting.times == 0) {
        each = lasting_.erase(each);
      } else {
        warn(each->first + " (" + std::to_string(lasting.times) + " more times in a minute)");
        lasting = {};
        ++each;
      }
    }
  }

  std::map<std::string, Lasting> lasting_;
  std::size_t most_;
  std::size_t bytes_ = 0;
  std::map<std::string, int> bySource_;
  int lines_ = 0;
  std::uint64_t suppressed_ = 0;
};

}  // namespace hapticd::server

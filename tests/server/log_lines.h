// Captures the log of the server instead of writing it to the terminal.
#pragma once

#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/dist_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace hapticd::test {

/// Where the log of a test program goes. Threads may log while it changes; spdlog's default logger may not be
/// exchanged beside them, so it is set once, before main().
inline const std::shared_ptr<spdlog::sinks::dist_sink_mt> kLogSinks = [] {
  auto sinks = std::make_shared<spdlog::sinks::dist_sink_mt>(spdlog::default_logger()->sinks());
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sinks));
  return sinks;
}();

/// The log goes here for as long as this lives.
class LogLines {
 public:
  LogLines() { kLogSinks->set_sinks({sink_}); }
  ~LogLines() { kLogSinks->set_sinks(before_); }
  LogLines(const LogLines&) = delete;
  LogLines& operator=(const LogLines&) = delete;

  /// Number of lines so far that contain this text.
  std::size_t count(const std::string& text) const {
    const std::vector<std::string> lines = sink_->lines();
    return static_cast<std::size_t>(std::count_if(lines.begin(), lines.end(), [&](const std::string& line) {
      return line.find(text) != std::string::npos;
    }));
  }
  /// The last 20 lines, for failure messages.
  std::string text() const {
    const std::vector<std::string> lines = sink_->lines();
    std::string end;
    for (std::size_t i = lines.size() > 20 ? lines.size() - 20 : 0; i < lines.size(); ++i)
      end += lines[i] + '\n';
    return end;
  }

 private:
  class Sink final : public spdlog::sinks::base_sink<std::mutex> {
   public:
    std::vector<std::string> lines() {
      const std::lock_guard lock(mutex_);
      return lines_;
    }

   private:
    void sink_it_(const spdlog::details::log_msg& message) override {
      lines_.emplace_back(message.payload.data(), message.payload.size());
    }
    void flush_() override {}

    std::vector<std::string> lines_;
  };

  const std::shared_ptr<Sink> sink_ = std::make_shared<Sink>();
  const std::vector<spdlog::sink_ptr> before_ = kLogSinks->sinks();
};

}  // namespace hapticd::test

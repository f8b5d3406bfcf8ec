// The log of the simulated server.
#pragma once

#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>

#include <functional>
#include <memory>
#include <string>

namespace hapticd::sim {

class LogSink final : public spdlog::sinks::base_sink<spdlog::details::null_mutex> {
 public:
  explicit LogSink(std::function<void(const std::string&)> line) : line_(std::move(line)) {}

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    line_(std::string(message.payload.data(), message.payload.size()));
  }
  void flush_() override {}
  const std::function<void(const std::string&)> line_;
};

/// The log of the server goes to a function for as long as this lives.
class ScopedLog {
 public:
  explicit ScopedLog(std::function<void(const std::string&)> line) : before_(spdlog::default_logger()) {
    auto sink = std::make_shared<LogSink>(std::move(line));
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("sim", std::move(sink)));
  }
  ~ScopedLog() { spdlog::set_default_logger(before_); }
  ScopedLog(const ScopedLog&) = delete;
  ScopedLog& operator=(const ScopedLog&) = delete;

 private:
  const std::shared_ptr<spdlog::logger> before_;
};

}  // namespace hapticd::sim

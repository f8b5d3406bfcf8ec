#include "log_writer.h"

#include <poll.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <climits>
#include <condition_variable>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kMostBytes = std::size_t{1} << 20;
constexpr auto kLastLines = 500ms;

const char* colourOf(spdlog::level::level_enum level) {
  switch (level) {
    case spdlog::level::warn:
      return "\033[33m\033[1m";
    case spdlog::level::err:
    case spdlog::level::critical:
      return "\033[31m\033[1m";
    case spdlog::level::info:
      return "\033[32m";
    default:
      return "\033[36m";
  }
}

}  // namespace

class LogWriter::Queue {
 public:
  void push(std::string_view line) {
    const std::lock_guard lock(mutex_);
    if (text_.size() + line.size() > kMostBytes) {
      ++dropped_;
      return;
    }
    text_ += line;
    changed_.notify_all();
  }

  // The thread.
  void run() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return !text_.empty() || ending_; });
      if (text_.empty()) break;
      std::string text = std::exchange(text_, {});
      if (const std::uint64_t dropped = std::exchange(dropped_, 0)) {
        text += "log: " + std::to_string(dropped) + " lines dropped because nobody read the output\n";
      }
      lock.unlock();
      write(text);
      lock.lock();
    }
    ended_ = true;
    changed_.notify_all();
  }

  void end() {
    std::unique_lock lock(mutex_);
    ending_ = true;
    changed_.notify_all();
    changed_.wait_for(lock, kLastLines, [this] { return ended_; });
  }

 private:
  // At most PIPE_BUF bytes after poll(), so that only this thread waits, and only for a reader.
  static void write(std::string_view text) {
    while (!text.empty()) {
      pollfd output{STDOUT_FILENO, POLLOUT, 0};
      if (poll(&output, 1, -1) < 0 && errno != EINTR) return;
      const long written = ::write(STDOUT_FILENO, text.data(), std::min<std::size_t>(text.size(), PIPE_BUF));
      if (written > 0) {
        text.remove_prefix(static_cast<std::size_t>(written));
      } else if (errno != EINTR && errno != EAGAIN) {
        return;  // the reader is gone, or the disk is full
      }
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::string text_;
  std::uint64_t dropped_ = 0;
  bool ending_ = false;
  bool ended_ = false;
};

LogWriter::LogWriter() : queue_(std::make_shared<Queue>()) {
  class Sink final : public spdlog::sinks::base_sink<std::mutex> {
   public:
    explicit Sink(std::shared_ptr<Queue> queue)
        : queue_(std::move(queue)), colours_(isatty(STDOUT_FILENO) == 1) {}

   private:
    void sink_it_(const spdlog::details::log_msg& message) override {
      spdlog::memory_buf_t buffer;
      formatter_->format(message, buffer);
      std::string line(buffer.data(), buffer.size());
      if (colours_ && message.color_range_end > message.color_range_start) {
        line.insert(message.color_range_end, "\033[m");
        line.insert(message.color_range_start, colourOf(message.level));
      }
      queue_->push(line);
    }
    void flush_() override {}

    std::shared_ptr<Queue> queue_;
    bool colours_;
  };
  std::thread([queue = queue_] { queue->run(); }).detach();
  auto logger = std::make_shared<spdlog::logger>("", std::make_shared<Sink>(queue_));
  logger->set_pattern("%H:%M:%S.%e %^%l%$ %v");
  spdlog::set_default_logger(std::move(logger));
}

LogWriter::~LogWriter() {
  queue_->end();
}

}  // namespace hapticd::apps

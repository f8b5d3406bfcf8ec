#include "base/thread.h"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "base/world.h"

namespace hapticd::base {
namespace {

void applyOptions(const ThreadOptions& options) noexcept {
  if (!options.name.empty()) pthread_setname_np(pthread_self(), options.name.substr(0, 15).c_str());
  // On Linux each thread has its own niceness. A refusal is harmless.
  if (options.niceness != 0) setpriority(PRIO_PROCESS, 0, options.niceness);
  if (options.priority == 0) return;
  sched_param parameters{};
  parameters.sched_priority = options.priority;
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

class SystemThread final : public Thread::Impl {
 public:
  SystemThread(ThreadOptions options, Step step)
      : options_(std::move(options)), step_(std::move(step)), thread_([this] { run(); }) {}
  ~SystemThread() override { stop(); }

  void wake() noexcept override {
    {
      const std::lock_guard lock(mutex_);
      woken_ = true;
    }
    wake_.notify_one();
  }

  void stop() override {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_one();
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run() {
    applyOptions(options_);
    for (bool last = false; !last;) {
      const std::optional<Nanos> deadline = step_();
      last = await(deadline);
    }
    step_();
  }

  // True when the thread should end.
  bool await(std::optional<Nanos> deadline) {
    std::unique_lock lock(mutex_);
    const auto ready = [this] { return woken_ || stopping_; };
    if (deadline) {
      // wait_until() on steady_clock is CLOCK_MONOTONIC, the servo clock.
      wake_.wait_until(lock, std::chrono::steady_clock::time_point(std::chrono::nanoseconds(*deadline)),
                       ready);
    } else {
      wake_.wait(lock, ready);
    }
    woken_ = false;
    return stopping_;
  }

  const ThreadOptions options_;
  const Step step_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool woken_ = false;
  bool stopping_ = false;
  std::thread thread_;  // last: its body uses the others
};

class SystemBlockingThread final : public BlockingThread::Impl {
 public:
  SystemBlockingThread(ThreadOptions options, std::function<void()> body)
      : thread_([options = std::move(options), body = std::move(body)] {
          applyOptions(options);
          body();
        }) {}
  ~SystemBlockingThread() override {
    if (thread_.joinable()) thread_.join();
  }
  void detach() noexcept override { thread_.detach(); }

 private:
  std::thread thread_;
};

class SystemPacedThread final : public PacedThread::Impl {
 public:
  SystemPacedThread(ThreadOptions options, Clock& clock, Step step)
      : thread_([options = std::move(options), &clock, step = std::move(step)] {
          applyOptions(options);
          while (const std::optional<Nanos> deadline = step()) clock.sleepUntil(*deadline);
        }) {}
  ~SystemPacedThread() override { thread_.join(); }

 private:
  std::thread thread_;
};

// The error of the system is the same for a lack of processes and of memory, and has no remedy.
template <typename T, typename... Rest>
std::unique_ptr<T> started(const ThreadOptions& options, Rest&&... rest) {
  try {
    return std::make_unique<T>(options, std::forward<Rest>(rest)...);
  } catch (const std::system_error& error) {
    throw std::system_error(error.code(), "cannot start the thread '" + options.name +
                                              "'; raise the limits 'ulimit -u' and 'ulimit -v'");
  }
}

}  // namespace

Thread::Thread(ThreadOptions options, Step step)
    : impl_(world().threads.start(std::move(options), std::move(step))) {}

Thread& Thread::operator=(Thread&& other) noexcept {
  stop();
  impl_ = std::move(other.impl_);
  return *this;
}

void Thread::stop() {
  if (impl_) impl_->stop();
  impl_.reset();
}

unsigned processors() noexcept {
  return std::max(1U, std::thread::hardware_concurrency());
}

BlockingThread::BlockingThread(ThreadOptions options, std::function<void()> body)
    : impl_(world().threads.startBlocking(std::move(options), std::move(body))) {}

PacedThread::PacedThread(ThreadOptions options, Clock& clock, Step step)
    : impl_(world().threads.startPaced(std::move(options), clock, std::move(step))) {}

std::unique_ptr<Thread::Impl> SystemThreads::start(ThreadOptions options, Step step) {
  return started<SystemThread>(options, std::move(step));
}

std::unique_ptr<BlockingThread::Impl> SystemThreads::startBlocking(ThreadOptions options,
                                                                   std::function<void()> body) {
  return started<SystemBlockingThread>(options, std::move(body));
}

std::unique_ptr<PacedThread::Impl> SystemThreads::startPaced(ThreadOptions options, Clock& clock, Step step) {
  return started<SystemPacedThread>(options, clock, std::move(step));
}

}  // namespace hapticd::base

// Threads as step functions, so that a simulated world can run the same code in one thread and choose the order.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/time.h"

namespace hapticd::base {

/// How a thread presents itself to the operating system.
struct ThreadOptions {
  std::string name;  ///< as `top -H` shows it; the first 15 bytes count
  int niceness = 0;  ///< 0 to 19; a higher one leaves the processor to others
};

/// One pass of a thread: does what is due and returns when it wants to run again on the servo clock, at the latest;
/// nothing: not before the next wake(). Must not wait for other threads. An exception that leaves it ends the process.
using Step = std::function<std::optional<Nanos>()>;

/// A thread that runs its step once at the start, after every wake() and at the time that the last step returned.
/// Several wake() calls between two steps make one step.
class Thread {
 public:
  /// What a world implements.
  class Impl {
   public:
    virtual ~Impl() = default;
    /// From any thread; never waits.
    virtual void wake() noexcept = 0;
    /// Runs one last step and ends. Idempotent.
    virtual void stop() = 0;
  };

  /// No thread yet.
  Thread() noexcept = default;
  /// Starts a thread of world(). Throws std::system_error when the system gives none.
  Thread(ThreadOptions options, Step step);
  Thread(Thread&&) noexcept = default;
  Thread& operator=(Thread&& other) noexcept;
  /// As stop().
  ~Thread() { stop(); }

  bool running() const noexcept { return impl_ != nullptr; }
  /// Asks for a step, from any thread; harmless where there is no thread.
  void wake() noexcept {
    if (impl_) impl_->wake();
  }
  /// Runs one last step and ends the thread; not from its own step. Idempotent.
  void stop();

 private:
  std::unique_ptr<Impl> impl_;
};

/// A thread that blocks in calls of its own, such as those of a vendor's library; simulated worlds have none. The body
/// must return soon after its owner asked for it; destruction waits for that.
class BlockingThread {
 public:
  class Impl {
   public:
    virtual ~Impl() = default;
  };

  BlockingThread() noexcept = default;
  /// Throws std::system_error when the system gives none.
  BlockingThread(ThreadOptions options, std::function<void()> body);

  bool running() const noexcept { return impl_ != nullptr; }
  /// Waits for the body to return. Idempotent.
  void join() { impl_.reset(); }

 private:
  std::unique_ptr<Impl> impl_;
};

/// Makes threads.
class Threads {
 public:
  virtual ~Threads() = default;
  virtual std::unique_ptr<Thread::Impl> start(ThreadOptions options, Step step) = 0;
  virtual std::unique_ptr<BlockingThread::Impl> startBlocking(ThreadOptions options, std::function<void()> body) = 0;
};

/// Threads of the operating system.
class SystemThreads final : public Threads {
 public:
  std::unique_ptr<Thread::Impl> start(ThreadOptions options, Step step) override;
  std::unique_ptr<BlockingThread::Impl> startBlocking(ThreadOptions options, std::function<void()> body) override;
};

}  // namespace hapticd::base

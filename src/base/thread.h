// Threads as step functions, so that a simulated world can run the same code in one thread and in a chosen
// order.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/clock.h"
#include "base/time.h"

namespace hapticd::base {

/// Processors that this process may use; at least 1.
unsigned processors() noexcept;

/// What the operating system sees of a thread.
struct ThreadOptions {
  std::string name;  ///< as in `top -H`; cut to 15 bytes
  int niceness = 0;  ///< 0 to 19; higher values yield the processor to other threads
  int priority = 0;  ///< 1 to 99: SCHED_FIFO where the system grants it; 0: normal scheduling
};

/// One pass of a thread: does the work that is due and returns the deadline of the next pass on the servo
/// clock, or nothing to run only after the next wake(). Must not wait for other threads. An exception that
/// leaves it ends the process.
using Step = std::function<std::optional<Nanos>()>;

/// A thread that runs its step once at the start, after every wake() and at the deadline that the last step
/// returned. Several wake() calls between two steps cause one step.
class Thread {
 public:
  /// Implemented by each world.
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
  /// Starts a thread of world(). Throws std::system_error when the system refuses.
  Thread(ThreadOptions options, Step step);
  Thread(Thread&&) noexcept = default;
  Thread& operator=(Thread&& other) noexcept;
  /// As stop().
  ~Thread() { stop(); }

  bool running() const noexcept { return impl_ != nullptr; }
  /// Requests a step. From any thread; no effect on an empty Thread.
  void wake() noexcept {
    if (impl_) impl_->wake();
  }
  /// Runs one last step and ends the thread. Not from the step itself. Idempotent.
  void stop();

 private:
  std::unique_ptr<Impl> impl_;
};

/// A thread that runs its step at the deadlines that the step itself returns and ends after a step that
/// returns none. It sleeps on a clock, takes no lock and cannot be woken, as a realtime loop needs it. The
/// first step may run before the constructor returns.
class PacedThread {
 public:
  class Impl {
   public:
    virtual ~Impl() = default;
  };

  PacedThread() noexcept = default;
  /// Starts a thread of world(). `clock` must outlive it. Throws std::system_error when the system refuses.
  PacedThread(ThreadOptions options, Clock& clock, Step step);

  bool running() const noexcept { return impl_ != nullptr; }
  /// Waits for the last step, which the owner must bring about: the next step returns no deadline.
  /// Idempotent.
  void join() { impl_.reset(); }

 private:
  std::unique_ptr<Impl> impl_;
};

/// A thread that blocks in calls that no world replaces, such as those of a vendor library; simulated worlds
/// have none. Its owner must make the body return before join(), destruction or assignment, all of which wait
/// for it.
class BlockingThread {
 public:
  class Impl {
   public:
    virtual ~Impl() = default;
    virtual void detach() noexcept = 0;
  };

  BlockingThread() noexcept = default;
  /// Starts a thread of world(). Throws std::system_error when the system refuses.
  BlockingThread(ThreadOptions options, std::function<void()> body);

  bool running() const noexcept { return impl_ != nullptr; }
  /// Waits for the body to return. Idempotent.
  void join() { impl_.reset(); }
  /// Waits for nothing: the thread ends with its body, which must own all that it uses, or with the process.
  void detach() noexcept {
    if (impl_) impl_->detach();
    impl_.reset();
  }

 private:
  std::unique_ptr<Impl> impl_;
};

/// Creates threads.
class Threads {
 public:
  virtual ~Threads() = default;
  virtual std::unique_ptr<Thread::Impl> start(ThreadOptions options, Step step) = 0;
  virtual std::unique_ptr<BlockingThread::Impl> startBlocking(ThreadOptions options,
                                                              std::function<void()> body) = 0;
  virtual std::unique_ptr<PacedThread::Impl> startPaced(ThreadOptions options, Clock& clock, Step step) = 0;
  /// Whether the threads are steps of a simulation: then nothing may be requested from the operating system
  /// for them.
  virtual bool simulated() const noexcept { return false; }
};

/// Threads of the operating system.
class SystemThreads final : public Threads {
 public:
  std::unique_ptr<Thread::Impl> start(ThreadOptions options, Step step) override;
  std::unique_ptr<BlockingThread::Impl> startBlocking(ThreadOptions options,
                                                      std::function<void()> body) override;
  std::unique_ptr<PacedThread::Impl> startPaced(ThreadOptions options, Clock& clock, Step step) override;
};

}  // namespace hapticd::base

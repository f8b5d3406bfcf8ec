// VRPN's counting semaphore and thread.
#ifndef VRPN_THREAD_H
#define VRPN_THREAD_H

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>

#define vrpn_THREADS_AVAILABLE

/// Counts free resources. p() and condP() return 1 when they took one, condP() 0 when none was free.
class vrpn_Semaphore {
 public:
  explicit vrpn_Semaphore(int resources = 1) : resources_(resources), free_(resources) {}
  vrpn_Semaphore(const vrpn_Semaphore&) = delete;
  vrpn_Semaphore& operator=(const vrpn_Semaphore&) = delete;

  /// Makes all resources free. Nobody may wait meanwhile.
  bool reset(int resources = 1) {
    const std::lock_guard<std::mutex> lock(mutex_);
    resources_ = free_ = resources;
    return true;
  }
  int p() {
    std::unique_lock<std::mutex> lock(mutex_);
    freed_.wait(lock, [this] { return free_ > 0; });
    --free_;
    return 1;
  }
  int condP() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (free_ <= 0) return 0;
    --free_;
    return 1;
  }
  /// Releases one; returns 0.
  int v() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ++free_;
    }
    freed_.notify_one();
    return 0;
  }
  int numResources() const { return resources_; }

 private:
  std::mutex mutex_;
  std::condition_variable freed_;
  int resources_;
  int free_;
};

namespace vrpn {

struct try_to_lock_t {};
const try_to_lock_t try_to_lock = {};

/// Holds one resource of a semaphore while it exists.
class SemaphoreGuard {
 public:
  explicit SemaphoreGuard(vrpn_Semaphore& semaphore) : semaphore_(semaphore) { lock(); }
  SemaphoreGuard(vrpn_Semaphore& semaphore, try_to_lock_t) : semaphore_(semaphore) { try_to_lock(); }
  ~SemaphoreGuard() { unlock(); }
  SemaphoreGuard(const SemaphoreGuard&) = delete;
  SemaphoreGuard& operator=(const SemaphoreGuard&) = delete;

  bool locked() const { return locked_; }
  void lock() {
    if (!locked_) locked_ = semaphore_.p() == 1;
  }
  bool try_to_lock() {
    if (!locked_) locked_ = semaphore_.condP() == 1;
    return locked_;
  }
  void unlock() {
    if (locked_) semaphore_.v();
    locked_ = false;
  }

 private:
  vrpn_Semaphore& semaphore_;
  bool locked_ = false;
};

}  // namespace vrpn

struct vrpn_ThreadData {
  void* pvUD;
};
typedef void (*vrpn_THREAD_FUNC)(vrpn_ThreadData& data);

/// Runs a function once go() is called. A thread cannot be stopped from outside: kill() is refused, and the
/// destructor waits for the end of the function.
class vrpn_Thread {
 public:
  typedef std::thread::native_handle_type thread_t;

  vrpn_Thread(vrpn_THREAD_FUNC function, vrpn_ThreadData data) : function_(function), data_(data) {}
  ~vrpn_Thread() {
    if (thread_.joinable()) thread_.join();
  }
  vrpn_Thread(const vrpn_Thread&) = delete;
  vrpn_Thread& operator=(const vrpn_Thread&) = delete;

  /// False when it runs already.
  bool go() {
    if (running()) return false;
    if (thread_.joinable()) thread_.join();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      running_ = true;
    }
    thread_ = std::thread([this] {
      function_(data_);
      const std::lock_guard<std::mutex> lock(mutex_);
      running_ = false;
    });
    return true;
  }
  bool kill() { return false; }
  bool running() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return running_;
  }
  thread_t pid() { return thread_.native_handle(); }
  static bool available() { return true; }
  static unsigned number_of_processors() { return std::thread::hardware_concurrency(); }
  void userData(void* data) { data_.pvUD = data; }
  void* userData() const { return data_.pvUD; }

 private:
  vrpn_THREAD_FUNC function_;
  vrpn_ThreadData data_;
  std::mutex mutex_;
  bool running_ = false;
  std::thread thread_;
};

#endif

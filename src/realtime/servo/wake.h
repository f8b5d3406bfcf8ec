// Tells a sleeping thread that there are reports (an eventfd, so that a poll loop can wait for it).
#pragma once

namespace hapticd::realtime {

/// notify() from the servo thread, the rest from the thread that waits.
class Wake {
 public:
  /// Throws std::system_error when the system has no descriptor left.
  Wake();
  ~Wake();
  Wake(const Wake&) = delete;
  Wake& operator=(const Wake&) = delete;

  /// One write that never blocks. noexcept, no allocation, no lock.
  void notify() noexcept;
  /// Readable when notified since the last drain().
  int descriptor() const noexcept { return descriptor_; }
  /// True when notified since the last drain().
  bool drain() noexcept;

 private:
  int descriptor_;
};

}  // namespace hapticd::realtime

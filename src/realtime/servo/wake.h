// Notifies a poll loop of new reports, through an eventfd.
#pragma once

namespace hapticd::realtime {

/// notify() from the servo thread, everything else from the thread that waits.
class Wake {
 public:
  /// Throws std::system_error when the system has no free descriptor.
  Wake();
  ~Wake();
  Wake(const Wake&) = delete;
  Wake& operator=(const Wake&) = delete;

  /// One non-blocking write. No allocation, no lock.
  void notify() noexcept;
  /// Readable after a notify() until the next drain().
  int descriptor() const noexcept { return descriptor_; }
  /// Clears the notification. True when there was a notify() since the last drain().
  bool drain() noexcept;

 private:
  int descriptor_;
};

}  // namespace hapticd::realtime

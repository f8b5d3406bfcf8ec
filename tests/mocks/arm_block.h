// What a test and a mock in another process share: where the hand is, what goes wrong, what the motors get.
// Time is counted in ticks of the mock. Device frame and SI: each mock converts to its vendor's by its own
// numbers.
#pragma once

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>

namespace hapticd::mock {

/// Names the file that holds the block; without it a mock is alone.
inline constexpr const char* kArmVariable = "HAPTICD_MOCK_ARM";
inline constexpr int kMostPlaces = 1024;
inline constexpr std::int64_t kLogTicks = 1 << 18;

enum Fault : int {
  kHealthy,
  kDoesNotOpen,
  kUnplugged,
  kWarmMotors,  ///< an error of the library
  kHotMotors,   ///< the temperature alone
  kNotCalibrated,
  kForceExceeded,   ///< the device's own limit, which also switches its amplifiers off where it has such
  kLibraryCrashes,  ///< in the thread that calls it
  kLibraryHangs,
  kOpeningHangs,
};

struct ArmTick {
  double force_N[3] = {};    ///< what the motors give from now on
  std::int64_t time_ns = 0;  ///< when they got it, since 1970
  int place = 0;             ///< where the hand was
  int fault = kHealthy;      ///< what was wrong
};

struct ArmBlock {
  // The test's.
  std::atomic<int> rest{
      0};  ///< the place where the hand rests; -1: it goes on by one place a tick, round and round
  std::atomic<int> fault{kHealthy};
  int places = 1;  ///< with the places: before the mock starts
  double place_m[kMostPlaces][3] = {};
  std::atomic<bool> docked{false};      ///< the stylus is in its inkwell
  std::atomic<double> gripper_rad{-1};  ///< of a device with one; below 0 before the mock starts: none

  // The mock's.
  std::atomic<std::int64_t> ticks{0};  ///< complete ones
  ArmTick log[kLogTicks] = {};         ///< tick n is in n % kLogTicks
  std::atomic<double> left_N[3] = {};  ///< what the motors give now
  std::atomic<int> amplifiers{0};
  std::atomic<int> watchdog_us{0};  ///< of the device; 0: none
  std::atomic<int> opened{0};       ///< how often
  std::atomic<int> closed{0};
};

/// The mock's side; every call does nothing without a block. One thread at a time.
class Arm {
 public:
  Arm() = default;
  explicit Arm(ArmBlock* block) : block_(block) {}
  static Arm ofEnvironment() {
    const char* path = std::getenv(kArmVariable);
    const int file = path != nullptr ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0) return {};
    void* memory = mmap(nullptr, sizeof(ArmBlock), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    return Arm(memory == MAP_FAILED ? nullptr : static_cast<ArmBlock*>(memory));
  }

  ArmBlock* operator->() const { return block_; }
  explicit operator bool() const { return block_ != nullptr; }
  int fault() const { return block_ != nullptr ? block_->fault.load() : kHealthy; }
  bool canOpen() const { return fault() != kDoesNotOpen && fault() != kUnplugged; }

  /// A tick begins; where the hand is in it.
  const double* begin() {
    const int rest = block_->rest;
    place_ = rest >= 0 ? rest : (place_ + 1) % block_->places;
    return block_->place_m[place_];
  }
  int place() const { return place_; }
  /// A tick ends with this force.
  void end(const double force_N[3], int place, int fault) {
    const std::int64_t tick = block_->ticks.load(std::memory_order_relaxed);
    ArmTick& entry = block_->log[tick % kLogTicks];
    for (int i = 0; i < 3; ++i) entry.force_N[i] = force_N[i];
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    entry.time_ns = now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
    entry.place = place;
    entry.fault = fault;
    leave(force_N);
    block_->ticks.store(tick + 1, std::memory_order_release);
  }
  void leave(const double force_N[3]) {
    for (int i = 0; i < 3; ++i) block_->left_N[i] = force_N[i];
  }
  void switchOff() {
    constexpr double kNothing[3] = {};
    if (block_ != nullptr) leave(kNothing);
  }

 private:
  ArmBlock* block_ = nullptr;
  int place_ = 0;
};

/// As a vendor's scheduler asks the system; nothing is lost where it is refused.
inline void askForRealtime() {
  sched_param parameters{};
  parameters.sched_priority = 60;
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

}  // namespace hapticd::mock

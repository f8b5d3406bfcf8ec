// Runs a driver in a process of its own, so that a crash of a vendor's library is a fault and does not end
// the server.
//
// The driver's process posts each state and writes the newest force, one tick late; without a fresh force for
// 3 ms (at rates below 500 Hz one and a half periods) it writes zero. Here, each post wakes the loop.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/thread.h"
#include "device/device.h"
#include "device/isolation/shared_block.h"
#include "device/sent_zero.h"

namespace hapticd::device {

struct IsolatedOptions {
  /// A program, with arguments, that calls runDeviceHost().
  std::vector<std::string> command;
  /// Sleep until shortly before a state is due, then watch for it for at most 0.3 ms: saves the time in which
  /// the system wakes a thread, and takes up to a third of a processor.
  bool watches = false;
};

/// Self-paced, in a thread of its own that the first tick may set up. A process that dies, or posts nothing
/// for 20 ms, is a fault; the ticks go on, every 10 ms, and close() and open() start a new process.
class IsolatedDevice final : public Device {
 public:
  explicit IsolatedDevice(IsolatedOptions options) : options_(std::move(options)) {}
  ~IsolatedDevice() override { close(); }

  void open() override;
  void close() noexcept override;
  const DeviceProfile& profile() const noexcept override { return profile_; }
  /// Those of the driver, but self-paced in a thread of ours.
  DeviceTraits traits() const noexcept override { return traits_; }

  bool read(Nanos now, DeviceState& state) noexcept override;
  bool write(const Vec3& force_N) noexcept override;
  bool zeroSent() const noexcept override;
  bool zeroFromOtherThread() noexcept override;

  /// Waits 5 ms at most for the driver's process, and tells what that said last where it takes longer.
  std::string faultText() const override;
  /// A new process does not know why the device was lost, so this one may tell first, if it does within 5 s.
  bool lost() const noexcept override { return silent_ || (lostThere_ && told_); }
  void calibrate(const std::function<bool()>& stopped) override;
  using Device::calibrate;
  void interrupt() noexcept override { interrupted_ = true; }

  void start(std::function<void(Nanos)> onTick) override;
  void stop() noexcept override;

  /// From the post of the state of this tick until the tick began; 0 for one that came later. In the tick
  /// only.
  Nanos postToTick() const noexcept { return postToTick_; }
  /// Of the driver's process; -1 when there is none.
  pid_t process() const noexcept { return process_; }

 private:
  void spawn(int socketOfChild);
  enum class Wait { toTheEnd, untilInterrupted };
  using Meanwhile = std::function<void(Nanos& end)>;  // often while an answer is waited for
  std::string receive(Nanos end, Wait wait, const Meanwhile& meanwhile = {}) const;
  std::string ask(const std::string& request, int most_ms) const;
  void send(const std::string& request) const;
  std::string takeAnswers(Nanos end, Wait wait, const Meanwhile& meanwhile = {}) const;
  std::string howItEnded(int most_ms) const;
  void run() noexcept;
  void waitForPost(std::uint32_t seen) const noexcept;
  void endProcess() noexcept;

  const IsolatedOptions options_;
  DeviceProfile profile_;
  DeviceTraits traits_{.selfPaced = true};
  std::unique_ptr<isolation::SharedMemory> memory_;
  std::atomic<pid_t> process_{-1};
  int socket_ = -1;
  mutable std::mutex socketMutex_;
  mutable int unanswered_ = 0;
  mutable Nanos asked_ = 0;          // the last request
  mutable bool faultAsked_ = false;  // by that request
  mutable bool askedWhileLost_ = false;
  mutable std::string late_;                  // text of a fault that the answer to a later request follows
  mutable std::optional<std::string> fault_;  // the last answer

  std::function<void(Nanos)> onTick_;
  base::BlockingThread thread_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> interrupted_{false};
  std::atomic<bool> silent_{false};
  std::atomic<bool> lostThere_{false};
  mutable std::atomic<bool> told_{false};  // the process has said why, or has had time to

  std::atomic<std::uint64_t> commands_{0};  // counted by the loop's thread

  // Loop's thread only.
  Nanos lastPost_ = 0;
  Nanos period_ = 0;  // between the last two posts
  Nanos postToTick_ = 0;
  SentZero sentZero_;
};

}  // namespace hapticd::device

// One thread that runs all threads of a server and the machines of its clients, in an order drawn from a
// seed.
//
// Steps take virtual time: after each one its thread is busy, and others run meanwhile. At hand-overs (a
// wake, a post, a call of the device, in the scene thread also a look at the clock: before each command) a
// step may be preempted: others run inside it before it goes on. So a step that blocks, such as a driver that
// hangs, lets all others run until its end.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/fake_world.h"
#include "net/fake_network.h"

namespace hapticd::sim {

using base::Nanos;

inline constexpr Nanos kMs = 1'000'000;

/// Random numbers of one purpose, the same for the same seed. Seeds are mixed: the states of the generator
/// form one sequence, on which neighbours must not be near each other.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(base::SeededRandom(seed).next()) {}
  std::uint64_t below(std::uint64_t end) { return end == 0 ? 0 : random_.next() % end; }
  Nanos between(Nanos least, Nanos most) {
    return least + static_cast<Nanos>(below(static_cast<std::uint64_t>(most - least + 1)));
  }
  double unit() { return static_cast<double>(random_.next() >> 11U) * 0x1p-53; }
  double uniform(double least, double most) { return least + unit() * (most - least); }
  bool chance(double probability) { return unit() < probability; }

 private:
  base::SeededRandom random_;
};

/// How much goes wrong with the machine of the server.
struct Adversity {
  double preempt = 0.01;  ///< probability at a hand-over
  double lateTick = 0;    ///< probability in a tick
  double netStall = 0;    ///< probability after an event of the net thread
  double sceneStall = 0;  ///< probability after a step of the scene thread
  double freeze = 0;      ///< probability per tick that the whole process stands still
  double suspend = 0;     ///< share of these that are suspensions of the machine
  Nanos longestSceneStall = 300'000'000;
};

/// Time in which somebody stood still.
class Stalls {
 public:
  void add(Nanos from, Nanos until) noexcept {
    from = std::max(from, until_);
    if (until <= from) return;
    sum_ += until - from;
    until_ = until;
  }
  /// Sum up to `now`.
  Nanos before(Nanos now) const noexcept { return sum_ - std::max<Nanos>(until_ - now, 0); }

 private:
  Nanos sum_ = 0;
  Nanos until_ = 0;
};

class Scheduler;

/// The clock of the world. sleepUntil() lets the others run until then.
class SimClock final : public base::Clock {
 public:
  explicit SimClock(Nanos wallAtZero) : wallOffset_(wallAtZero) {}
  Nanos now() noexcept override;
  /// The same for the simulation itself: no hand-over.
  Nanos time() const noexcept { return now_; }
  void sleepUntil(Nanos deadline) noexcept override;
  Nanos wallNow() noexcept override { return now_ + wallOffset_; }
  Nanos suspendedTime() noexcept override { return suspended_; }

  void stepWall(Nanos by) noexcept { wallOffset_ += by; }
  void suspendFor(Nanos duration) noexcept {
    suspended_ += duration;
    wallOffset_ += duration;
  }

 private:
  friend class Scheduler;
  Nanos now_ = 0;
  Nanos wallOffset_;
  Nanos suspended_ = 0;
  Scheduler* scheduler_ = nullptr;
};

class Scheduler final : public base::Threads, public net::FakeNetwork {
 public:
  /// Findings of the scheduler itself, such as a thread that waits for another one, go to `finding`.
  Scheduler(SimClock& clock, std::uint64_t seed, const Adversity& adversity,
            std::function<void(const std::string&)> finding);

  // base::Threads
  std::unique_ptr<base::Thread::Impl> start(base::ThreadOptions thread, base::Step step) override;
  std::unique_ptr<base::BlockingThread::Impl> startBlocking(base::ThreadOptions thread,
                                                            std::function<void()> body) override;
  std::unique_ptr<base::PacedThread::Impl> startPaced(base::ThreadOptions thread, base::Clock& clock,
                                                      base::Step step) override;
  bool simulated() const noexcept override { return true; }

  // net::FakeNetwork
  bool runNext(Nanos limit) override;

  /// The loop with this number is the server's: its events cost the time of the net thread.
  void setServerLoop(std::size_t number) { serverLoop_ = number; }
  using FakeNetwork::loops;
  /// A hand-over: may let others run before it returns.
  void handOver() noexcept;
  /// The running step has asked for the time.
  void timeAsked() noexcept;
  /// Lets the others run until then.
  void runUntil(Nanos end) noexcept;
  /// Charges the running event of the net thread.
  void chargeNet(Nanos cost) { netCost_ += cost; }
  /// Time up to now in which the net thread could not run, for reasons that are not the server's.
  Nanos netStalled() const noexcept { return netStalls_.before(clock_.now_); }
  /// The same of the scene threads.
  Nanos sceneStalled() const noexcept { return sceneStalls_.before(clock_.now_); }
  /// From now on allocations of this size and more fail in the steps of the scene and of the web port's
  /// workers; with 0, none.
  void limitMemory(std::size_t fromBytes) { memoryLimit_ = fromBytes; }
  /// Called when the machine was suspended.
  std::function<void()> onSuspended;
  /// Ends preemption and stalls, as before the end of a server; or lets them begin again.
  void calm(bool calm = true) { calm_ = calm; }

  std::uint64_t steps() const noexcept { return steps_; }
  std::uint64_t faults() const noexcept { return faults_; }
  std::uint64_t preemptions() const noexcept { return preemptions_; }

 protected:
  void posted() override;

 private:
  class Task;
  class TaskThread;
  class TaskPaced;

  void run(Task& task);
  void runNet();
  Nanos costOf(Task& task);
  void maybeFreeze();

  SimClock& clock_;
  Dice dice_;
  const Adversity adversity_;
  const std::function<void(const std::string&)> finding_;
  std::vector<Task*> tasks_;
  std::vector<std::size_t> ready_;  // scratch
  std::vector<Nanos> whens_;        // of loops and tasks, in the present step
  std::size_t serverLoop_ = 0;
  Nanos netBusyUntil_ = 0;
  Nanos netCost_ = 0;
  bool netRuns_ = false;
  bool clientRuns_ = false;
  int depth_ = 0;                    // of steps of tasks
  const Task* innermost_ = nullptr;  // unless a loop runs inside
  bool calm_ = false;
  std::size_t memoryLimit_ = 0;
  Stalls netStalls_;
  Stalls sceneStalls_;
  std::uint64_t steps_ = 0;
  std::uint64_t faults_ = 0;
  std::uint64_t preemptions_ = 0;
};

}  // namespace hapticd::sim

#include "sim/scheduler.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include "sim/memory.h"

namespace hapticd::sim {
namespace {

constexpr int kDeepest = 4;

}  // namespace

Nanos SimClock::now() noexcept {
  if (scheduler_ != nullptr) scheduler_->timeAsked();
  return now_;
}

void SimClock::sleepUntil(Nanos deadline) noexcept {
  if (deadline > now_) scheduler_->runUntil(deadline);
}

// A thread of the server.
class Scheduler::Task {
 public:
  Task(Scheduler& scheduler, std::string taskName, base::Step taskStep)
      : name(std::move(taskName)), step(std::move(taskStep)), scheduler_(scheduler) {
    scheduler_.tasks_.push_back(this);
    due = scheduler_.clock_.now_;
  }
  ~Task() { std::erase(scheduler_.tasks_, this); }
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;

  void wake() noexcept {
    if (running) {
      woken = true;
    } else if (!due || *due > scheduler_.clock_.now_) {
      due = scheduler_.clock_.now_;
    }
  }
  std::optional<Nanos> call() {
    struct Running {
      explicit Running(Task& of) : task(of) {
        task.running = true;
        ++task.scheduler_.depth_;
        task.scheduler_.innermost_ = &task;
      }
      ~Running() {
        task.running = false;
        --task.scheduler_.depth_;
        task.scheduler_.innermost_ = nullptr;
      }
      Task& task;
    } const scope(*this);
    const LimitedMemory memory(memoryLimit());
    hasRun = true;
    woken = false;
    ++scheduler_.steps_;
    return step();
  }
  // Only of threads that allocate much. The JSON library allocates in destructors, in which nothing may fail:
  // some bytes for each child of a value.
  std::size_t memoryLimit() const {
    constexpr std::size_t kLeastOfTexts = 16'384;
    const std::size_t limit = scheduler_.memoryLimit_;
    if (name == "web-text" && limit != 0) return std::max(limit, kLeastOfTexts);
    return name == "scene" || name == "web-mesh" ? limit : 0;
  }
  // What a thread that waits for this one would see: true when it need not wait.
  bool joinable(const char* what) const {
    if (!running) return true;
    scheduler_.finding_(std::string(what) + " waits for the thread '" + name + "', which is in its step");
    return false;
  }

  const std::string name;
  const base::Step step;
  std::optional<Nanos> due;  // nothing: waits for a wake
  Nanos busyUntil = 0;
  bool running = false;
  bool woken = false;
  bool hasRun = false;

 private:
  Scheduler& scheduler_;
};

class Scheduler::TaskThread final : public base::Thread::Impl {
 public:
  TaskThread(Scheduler& scheduler, std::string name, base::Step step)
      : scheduler_(scheduler), task_(std::make_unique<Task>(scheduler, std::move(name), std::move(step))) {}
  ~TaskThread() override { stop(); }

  void wake() noexcept override {
    if (!task_) return;
    task_->wake();
    scheduler_.handOver();
  }
  void stop() override {
    if (!task_) return;
    if (!task_->joinable("stop()")) throw std::logic_error("a simulated thread waits for another one");
    const bool calm = std::exchange(scheduler_.calm_, true);
    if (!task_->hasRun) task_->call();
    task_->call();
    scheduler_.calm_ = calm;
    task_.reset();
  }

 private:
  Scheduler& scheduler_;
  std::unique_ptr<Task> task_;
};

class Scheduler::TaskPaced final : public base::PacedThread::Impl {
 public:
  TaskPaced(Scheduler& scheduler, std::string name, base::Step step)
      : scheduler_(scheduler), task_(scheduler, std::move(name), std::move(step)) {
    task_.due = task_.call();
  }
  ~TaskPaced() override {
    task_.joinable("join()");
    if (!task_.due || task_.running) return;
    const bool calm = std::exchange(scheduler_.calm_, true);
    task_.call();
    scheduler_.calm_ = calm;
  }

 private:
  Scheduler& scheduler_;
  Task task_;
};

Scheduler::Scheduler(SimClock& clock, std::uint64_t seed, const Adversity& adversity,
                     std::function<void(const std::string&)> finding)
    : FakeNetwork(clock), clock_(clock), dice_(seed), adversity_(adversity), finding_(std::move(finding)) {
  clock.scheduler_ = this;
}

std::unique_ptr<base::Thread::Impl> Scheduler::start(base::ThreadOptions thread, base::Step step) {
  return std::make_unique<TaskThread>(*this, std::move(thread.name), std::move(step));
}

std::unique_ptr<base::BlockingThread::Impl> Scheduler::startBlocking(base::ThreadOptions thread,
                                                                     std::function<void()>) {
  throw std::logic_error("the simulator cannot run the blocking thread " + thread.name);
}

std::unique_ptr<base::PacedThread::Impl> Scheduler::startPaced(base::ThreadOptions thread, base::Clock&,
                                                               base::Step step) {
  return std::make_unique<TaskPaced>(*this, std::move(thread.name), std::move(step));
}

bool Scheduler::runNext(Nanos limit) {
  constexpr Nanos kNever = std::numeric_limits<Nanos>::max();
  // Index: loops first, then tasks.
  const std::size_t loopCount = loops();
  const auto whenOf = [&](std::size_t index) {
    if (index < loopCount) {
      const bool server = index == serverLoop_;
      if (server ? netRuns_ : clientRuns_) return kNever;
      const auto next = nextOf(index);
      if (!next) return kNever;
      return server ? std::max(*next, netBusyUntil_) : *next;
    }
    const Task& task = *tasks_[index - loopCount];
    if (task.running || !task.due) return kNever;
    // It joins the threads of its device, which must not be inside a step then.
    if (depth_ > 0 && task.name == "device keeper") return kNever;
    return std::max(*task.due, task.busyUntil);
  };
  const std::size_t count = loopCount + tasks_.size();
  whens_.resize(count);
  for (std::size_t i = 0; i < count; ++i) whens_[i] = whenOf(i);
  const Nanos earliest = whens_.empty() ? kNever : *std::min_element(whens_.begin(), whens_.end());
  if (earliest == kNever || earliest > limit) return false;
  const Nanos at = std::max(earliest, clock_.now_);
  ready_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    if (whens_[i] <= at) ready_.push_back(i);
  }
  const std::size_t chosen = ready_[dice_.below(ready_.size())];
  clock_.now_ = at;
  // A step that is preempted may be short of memory; what runs inside it is not.
  const LimitedMemory memory(0);
  const Task* const preempted = std::exchange(innermost_, nullptr);
  if (chosen >= loopCount) {
    run(*tasks_[chosen - loopCount]);
  } else if (chosen == serverLoop_) {
    runNet();
  } else {
    clientRuns_ = true;
    runNextOf(chosen);
    clientRuns_ = false;
  }
  innermost_ = preempted;
  return true;
}

void Scheduler::run(Task& task) {
  const bool servo = task.name == "servo";
  task.due.reset();
  // The step may end the thread of another task, but not this one.
  const std::optional<Nanos> deadline = task.call();
  if (task.woken) {
    task.due = clock_.now_;
  } else {
    task.due = deadline;
  }
  task.busyUntil = clock_.now_ + costOf(task);
  if (!servo) return;
  pollWatches();
  maybeFreeze();
}

void Scheduler::runNet() {
  netRuns_ = true;
  netCost_ = 0;
  ++steps_;
  runNextOf(serverLoop_);
  netRuns_ = false;
  netBusyUntil_ = clock_.now_ + dice_.between(1'000, 8'000) + netCost_;
  if (!calm_ && dice_.chance(adversity_.netStall)) {
    ++faults_;
    const Nanos end = netBusyUntil_ + dice_.between(kMs, 140 * kMs);
    netStalls_.add(netBusyUntil_, end);
    netBusyUntil_ = end;
  }
}

Nanos Scheduler::costOf(Task& task) {
  if (calm_) return 0;
  if (task.name == "servo") {
    if (!dice_.chance(adversity_.lateTick)) return dice_.between(20'000, 80'000);
    ++faults_;
    return dice_.chance(0.2) ? dice_.between(20 * kMs, 80 * kMs) : dice_.between(kMs, 20 * kMs);
  }
  if (task.name == "scene") {
    if (!dice_.chance(adversity_.sceneStall)) return dice_.between(20'000, 300'000);
    ++faults_;
    const Nanos length = dice_.between(kMs, adversity_.longestSceneStall);
    sceneStalls_.add(clock_.now_, clock_.now_ + length);
    return length;
  }
  if (task.name == "watchdog") return dice_.between(2'000, 20'000);
  return dice_.between(10'000, 500'000);
}

void Scheduler::maybeFreeze() {
  if (calm_ || depth_ > 0 || netRuns_ || !dice_.chance(adversity_.freeze)) return;
  ++faults_;
  const Nanos length = dice_.between(10 * kMs, 3000 * kMs);
  if (dice_.chance(adversity_.suspend)) {
    clock_.suspendFor(dice_.between(200 * kMs, 100'000 * kMs));
    if (onSuspended) onSuspended();
    return;
  }
  const Nanos end = clock_.now_ + length;
  for (Task* task : tasks_) task->busyUntil = std::max(task->busyUntil, end);
  netStalls_.add(std::max(clock_.now_, netBusyUntil_), end);
  sceneStalls_.add(clock_.now_, end);
  netBusyUntil_ = std::max(netBusyUntil_, end);
}

void Scheduler::posted() {
  if (!clientRuns_) handOver();
}

void Scheduler::handOver() noexcept {
  if (calm_ || clientRuns_ || depth_ + (netRuns_ ? 1 : 0) == 0 || depth_ >= kDeepest) return;
  if (!dice_.chance(adversity_.preempt)) return;
  ++preemptions_;
  runUntil(clock_.now_ + dice_.between(0, 300'000));
}

// The scene thread holds no lock when it looks at the clock.
void Scheduler::timeAsked() noexcept {
  if (innermost_ != nullptr && innermost_->name == "scene") handOver();
}

void Scheduler::runUntil(Nanos end) noexcept {
  const Nanos begin = clock_.now_;
  while (runNext(end)) {
  }
  clock_.now_ = std::max(clock_.now_, end);
  if (netRuns_) netStalls_.add(begin, clock_.now_);
}

}  // namespace hapticd::sim

#include "base/worker.h"

#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/fake_world.h"

namespace hapticd::base {
namespace {

TEST(Worker, RunsJobsInOrder) {
  std::vector<int> order;
  std::promise<void> done;
  Worker worker("test");
  for (int i = 0; i < 100; ++i) worker.post([&order, i] { order.push_back(i); });
  worker.post([&done] { done.set_value(); });
  done.get_future().wait();
  ASSERT_EQ(order.size(), 100u);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(order[static_cast<std::size_t>(i)], i);
}

TEST(Worker, RunsAJobThatIsPostedAfterAnIdleTime) {
  Worker worker("test");
  int runs = 0;
  for (int i = 0; i < 3; ++i) {
    std::promise<void> done;
    worker.post([&] {
      ++runs;
      done.set_value();
    });
    done.get_future().wait();
  }
  EXPECT_EQ(runs, 3);
}

TEST(Worker, TellsOfAJobThatThrowsAndGoesOn) {
  Worker worker("test");
  std::promise<void> done;
  std::string failure;
  bool failedToo = false;
  worker.post([] { throw std::runtime_error("on purpose"); });  // nobody wants to know
  worker.post([] { throw std::runtime_error("the reason"); },
              [&failure](const std::exception& error) { failure = error.what(); });
  worker.post([] {}, [&failedToo](const std::exception&) { failedToo = true; });
  worker.post([&done] { done.set_value(); });
  ASSERT_EQ(done.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  EXPECT_EQ(failure, "the reason");
  EXPECT_FALSE(failedToo);
}

TEST(Worker, RunsAJobOfEachAskerInTurnUntilItStops) {
  SimulatedClock clock;
  FakeThreads threads(clock);
  const World& real = world();
  const ScopedWorld fake({real.clock, threads, real.files, real.random});
  std::string order;
  Worker worker("test");
  const auto post = [&](std::uint32_t asker, char name) {
    worker.postFor(asker, [&order, name] { order += name; });
  };
  for (const char name : {'a', 'b', 'c', 'd'}) post(7, name);
  post(9, 'X');
  post(5, 'Y');
  worker.postFor(9, [] { throw std::bad_alloc(); });
  post(9, 'Z');
  threads.runDue();
  EXPECT_EQ(order, "YaXbcZd");
  post(7, 'e');
  worker.stop();
  post(7, 'f');
  threads.runDue();
  EXPECT_EQ(order, "YaXbcZd");
}

/// Threads that run a step only when they are stopped.
class LazyThreads final : public Threads {
 public:
  class Lazy final : public Thread::Impl {
   public:
    explicit Lazy(Step step) : step_(std::move(step)) {}
    void wake() noexcept override {}
    void stop() override { step_(); }

   private:
    Step step_;
  };

  std::unique_ptr<Thread::Impl> start(ThreadOptions options, Step step) override {
    started.push_back(std::move(options));
    return std::make_unique<Lazy>(std::move(step));
  }
  std::unique_ptr<BlockingThread::Impl> startBlocking(ThreadOptions, std::function<void()>) override {
    throw std::logic_error("a worker has no blocking thread");
  }
  std::unique_ptr<PacedThread::Impl> startPaced(ThreadOptions, Clock&, Step) override {
    throw std::logic_error("a worker has no paced thread");
  }

  std::vector<ThreadOptions> started;
};

TEST(Worker, StartsOneNiceThreadWithTheFirstJobAndDiscardsQueuedJobsAtTheEnd) {
  LazyThreads threads;
  const World& real = world();
  const ScopedWorld world({real.clock, threads, real.files, real.random});
  int runs = 0;
  {
    Worker worker("web-text");
    EXPECT_TRUE(threads.started.empty());
    worker.post([&runs] { ++runs; });
    worker.post([&runs] { ++runs; });
  }
  EXPECT_EQ(runs, 0);
  ASSERT_EQ(threads.started.size(), 1u);
  EXPECT_EQ(threads.started[0].name, "web-text");
  EXPECT_EQ(threads.started[0].niceness, 10);
}

}  // namespace
}  // namespace hapticd::base

#include "server/web/worker.h"

#include <gtest/gtest.h>

#include <future>
#include <stdexcept>
#include <vector>

#include "base/world.h"

namespace hapticd::server {
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

TEST(Worker, ReportsAJobThatThrowsAndGoesOn) {
  Worker worker("test");
  std::promise<void> done;
  bool failed = false;
  bool failedToo = false;
  worker.post([] { throw std::runtime_error("on purpose"); }, [&failed] { failed = true; });
  worker.post([] {}, [&failedToo] { failedToo = true; });
  worker.post([&done] { done.set_value(); });
  ASSERT_EQ(done.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  EXPECT_TRUE(failed);
  EXPECT_FALSE(failedToo);
}

/// Threads that run a step only when they are stopped.
class LazyThreads final : public base::Threads {
 public:
  class Lazy final : public base::Thread::Impl {
   public:
    explicit Lazy(base::Step step) : step_(std::move(step)) {}
    void wake() noexcept override {}
    void stop() override { step_(); }

   private:
    base::Step step_;
  };

  std::unique_ptr<base::Thread::Impl> start(base::ThreadOptions options, base::Step step) override {
    started.push_back(std::move(options));
    return std::make_unique<Lazy>(std::move(step));
  }
  std::unique_ptr<base::BlockingThread::Impl> startBlocking(base::ThreadOptions,
                                                            std::function<void()>) override {
    throw std::logic_error("a worker has no blocking thread");
  }
  std::unique_ptr<base::PacedThread::Impl> startPaced(base::ThreadOptions, base::Clock&,
                                                      base::Step) override {
    throw std::logic_error("a worker has no paced thread");
  }

  std::vector<base::ThreadOptions> started;
};

TEST(Worker, StartsOneNiceThreadWithTheFirstJobAndDiscardsQueuedJobsAtTheEnd) {
  LazyThreads threads;
  const base::World& real = base::world();
  const base::ScopedWorld world({real.clock, threads, real.files, real.random});
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
}  // namespace hapticd::server

#include "net/loop.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

using std::chrono::milliseconds;

TEST(Loop, PostFromAnotherThreadRunsInOrderInTheLoopsThread) {
  constexpr int kCount = 1000;
  Loop loop;
  std::vector<int> order;
  std::thread::id ran;
  std::thread poster([&] {
    for (int i = 0; i < kCount; ++i) {
      loop.post([&, i] {
        order.push_back(i);
        ran = std::this_thread::get_id();
      });
    }
    loop.post([&] { loop.stop(); });
  });
  loop.run();
  poster.join();
  ASSERT_EQ(order.size(), static_cast<std::size_t>(kCount));
  for (int i = 0; i < kCount; ++i) {
    ASSERT_EQ(order[static_cast<std::size_t>(i)], i);
  }
  EXPECT_EQ(ran, std::this_thread::get_id());
}

TEST(Loop, StopFromAnotherThreadEndsRunAndItCanRunAgain) {
  Loop loop;
  std::thread stopper([&] { loop.stop(); });
  loop.run();
  stopper.join();
  bool ran = false;
  loop.post([&] {
    ran = true;
    loop.stop();
  });
  loop.run();
  EXPECT_TRUE(ran);
}

TEST(Loop, RunOnceReturnsZeroWhenNothingHappens) {
  Loop loop;
  EXPECT_EQ(loop.runOnce(milliseconds(0)), 0u);
  EXPECT_EQ(loop.runOnce(milliseconds(1)), 0u);
  loop.post([] {});
  EXPECT_GT(loop.runOnce(milliseconds(0)), 0u);
  EXPECT_EQ(loop.runOnce(milliseconds(0)), 0u);
}

TEST(Loop, RunForSleepsForItsWholeTimeAndHandlesWhatCame) {
  Loop loop;
  bool ran = false;
  loop.post([&] { ran = true; });
  const auto begin = std::chrono::steady_clock::now();
  loop.runFor(milliseconds(20));
  EXPECT_GE(std::chrono::steady_clock::now() - begin, milliseconds(20));
  EXPECT_TRUE(ran);
}

TEST(Loop, APostedFunctionIsOneEventHoweverLongItTakes) {
  Loop loop;
  loop.post([] { std::this_thread::sleep_for(milliseconds(2)); });
  EXPECT_EQ(loop.runOnce(milliseconds(0)), 1u);
  EXPECT_EQ(loop.runOnce(milliseconds(0)), 0u);
}

TEST(Loop, RefusesToRunInsideItsOwnCallback) {
  Loop loop;
  std::string error;
  loop.setErrorHandler([&](std::string_view text) { error = text; });
  loop.post([&] { loop.runOnce(milliseconds(0)); });
  EXPECT_EQ(loop.runOnce(milliseconds(0)), 1u);
  EXPECT_NE(error.find("inside one of its own callbacks"), std::string::npos);
}

TEST(Loop, ExceptionsGoToTheErrorHandlerAndTheLoopGoesOn) {
  Loop loop;
  std::vector<std::string> errors;
  loop.setErrorHandler([&](std::string_view text) { errors.emplace_back(text); });
  loop.post([] { throw std::runtime_error("posted"); });
  loop.post([] { throw 7; });
  int ticks = 0;
  const Subscription timer = loop.every(milliseconds(1), [&] {
    if (++ticks == 1) {
      throw std::runtime_error("timer");
    }
  });
  ASSERT_TRUE(pumpUntil(loop, [&] { return ticks >= 2; }));
  // In any order: on a slow machine the timer may be due before what was posted has run.
  std::sort(errors.begin(), errors.end());
  EXPECT_EQ(errors, (std::vector<std::string>{"an exception of unknown type", "posted", "timer"}));
}

TEST(Timer, OneShotFiresOnceNotBeforeItsTime) {
  Loop loop;
  int fired = 0;
  const auto begin = std::chrono::steady_clock::now();
  Subscription timer = loop.after(milliseconds(5), [&] { ++fired; });
  EXPECT_TRUE(timer.active());
  ASSERT_TRUE(pumpUntil(loop, [&] { return fired > 0; }));
  EXPECT_GE(std::chrono::steady_clock::now() - begin, milliseconds(5));
  EXPECT_FALSE(timer.active());
  loop.runFor(milliseconds(10));
  EXPECT_EQ(fired, 1);
}

TEST(Timer, CancelledOneNeverFiresEvenWhenAlreadyDue) {
  Loop loop;
  bool fired = false;
  Subscription victim;
  // Both are due in the same pass: the first cancels the second, whose completion is already queued.
  const Subscription first = loop.after(milliseconds(0), [&] { victim.cancel(); });
  victim = loop.after(milliseconds(0), [&] { fired = true; });
  std::this_thread::sleep_for(milliseconds(2));
  loop.runFor(milliseconds(5));
  EXPECT_FALSE(fired);
}

TEST(Timer, MayDestroyOrReplaceItselfInItsCallback) {
  Loop loop;
  const auto token = std::make_shared<int>(0);
  Subscription timer;
  timer = loop.every(milliseconds(1), [&, token] {
    ++*token;
    timer = loop.after(milliseconds(1), [&, token] {
      timer.cancel();
      *token += 10;
    });
    ++*token;
  });
  ASSERT_TRUE(pumpUntil(loop, [&] { return *token == 12; }));
  loop.runFor(milliseconds(5));
  EXPECT_EQ(*token, 12);
  EXPECT_EQ(token.use_count(), 1) << "a cancelled timer keeps its callback alive";
}

TEST(Watch, EventFdWrittenByAnotherThreadWakesTheLoop) {
  constexpr std::uint64_t kTicks = 2000;
  Loop loop;
  const int fd = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  std::uint64_t seen = 0;
  const Subscription watch = loop.watchFd(fd, [&] { seen += drainEventFd(fd); });
  std::thread writer([&] {
    for (std::uint64_t i = 0; i < kTicks; ++i) {
      const std::uint64_t one = 1;
      ASSERT_EQ(::write(fd, &one, sizeof one), static_cast<ssize_t>(sizeof one));
    }
  });
  EXPECT_TRUE(pumpUntil(loop, [&] { return seen == kTicks; }));
  writer.join();
  ::close(fd);
}

TEST(Watch, CallsAgainWhileTheDescriptorStaysReadable) {
  Loop loop;
  const int fd = ::eventfd(1, EFD_NONBLOCK | EFD_CLOEXEC);
  int calls = 0;
  Subscription watch = loop.watchFd(fd, [&] {
    if (++calls == 3) {
      drainEventFd(fd);
    }
  });
  ASSERT_TRUE(pumpUntil(loop, [&] { return calls == 3; }));
  EXPECT_EQ(loop.runOnce(milliseconds(0)), 0u);
  watch.cancel();
  const std::uint64_t one = 1;
  ASSERT_EQ(::write(fd, &one, sizeof one), static_cast<ssize_t>(sizeof one));
  loop.runFor(milliseconds(2));
  EXPECT_EQ(calls, 3);
  EXPECT_EQ(drainEventFd(fd), 1u) << "the caller's descriptor was closed";
  ::close(fd);
}

TEST(Watch, TellsOfDescriptorsThatCannotBeWatched) {
  Loop loop;
  EXPECT_THROW((void)loop.watchFd(-1, [] {}), Error);
  const int file = ::open("/proc/self/exe", O_RDONLY | O_CLOEXEC);
  std::vector<std::string> errors;
  loop.setErrorHandler([&](std::string_view text) { errors.emplace_back(text); });
  const Subscription watch = loop.watchFd(file, [] { ADD_FAILURE() << "a regular file was watched"; });
  ASSERT_TRUE(pumpUntil(loop, [&] { return !errors.empty(); }));
  loop.runFor(milliseconds(2));
  EXPECT_EQ(errors.size(), 1u);
  EXPECT_FALSE(watch.active());
  ::close(file);
}

}  // namespace
}  // namespace hapticd::net

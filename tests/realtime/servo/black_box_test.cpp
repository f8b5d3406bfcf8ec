#include "realtime/servo/black_box.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace hapticd::realtime {
namespace {

TickReport numbered(std::uint64_t tick) {
  TickReport report;
  report.tick = tick;
  report.time = static_cast<Nanos>(tick);
  return report;
}

TEST(BlackBox, KeepsTheNewestUntilTaken) {
  BlackBox box(3);
  for (std::uint64_t i = 1; i <= 5; ++i) box.record(numbered(i));
  EXPECT_TRUE(box.take().empty()) << "nothing has happened";
  box.freeze();
  box.record(numbered(6));
  const auto story = box.take();
  ASSERT_EQ(story.size(), 3U);
  EXPECT_EQ(story[0].tick, 3U);
  EXPECT_EQ(story[2].tick, 5U);
  box.record(numbered(7));
  box.freeze();
  ASSERT_EQ(box.take().size(), 1U) << "a gap would be mistaken for a story";
}

TEST(BlackBox, IsTakenWhileTheServoGoesOn) {
  BlackBox box(50);
  std::atomic<bool> done{false};
  std::thread servo([&] {
    for (std::uint64_t i = 1; !done; ++i) {
      box.record(numbered(i));
      if (i % 64 == 0) box.freeze();
    }
  });
  for (int stories = 0; stories < 50;) {
    const auto story = box.take();
    if (story.empty()) {
      std::this_thread::yield();
      continue;
    }
    ++stories;
    for (std::size_t i = 1; i < story.size(); ++i) ASSERT_EQ(story[i].tick, story[i - 1].tick + 1);
    for (const TickReport& report : story) ASSERT_EQ(report.time, static_cast<Nanos>(report.tick));
  }
  done = true;
  servo.join();
}

}  // namespace
}  // namespace hapticd::realtime

// The hand-offs under random interleavings in one thread and real ones in two.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <deque>
#include <random>
#include <thread>
#include <vector>

#include "handoff/latest_value.h"
#include "scene/snapshot_slot.h"

namespace hapticd::handoff {
namespace {

using scene::SnapshotSlot;

#ifdef HAPTICD_SANITIZED
constexpr int kRounds = 20'000;
#else
constexpr int kRounds = 200'000;
#endif

// Counts live snapshots and where they are freed.
struct Census {
  std::atomic<int> alive{0};
  std::atomic<int> freed{0};
  std::atomic<int> freedElsewhere{0};
  std::thread::id home = std::this_thread::get_id();

  std::shared_ptr<const scene::SceneSnapshot> make(std::uint64_t revision) {
    auto* snapshot = new scene::SceneSnapshot;
    snapshot->revision = revision;
    ++alive;
    return {snapshot, [this](const scene::SceneSnapshot* s) {
              if (std::this_thread::get_id() != home) ++freedElsewhere;
              const_cast<scene::SceneSnapshot*>(s)->revision = 0;  // visible to a reader that still uses it
              delete s;
              --alive;
              ++freed;
            }};
  }
};

TEST(SnapshotSlot, IsEmptyUntilThePublisherSpeaks) {
  Census census;
  SnapshotSlot slot;
  EXPECT_EQ(slot.take(), nullptr);
  slot.publish(census.make(7));
  ASSERT_NE(slot.take(), nullptr);
  EXPECT_EQ(slot.take()->revision, 7U);
}

TEST(SnapshotSlot, KeepsThePreviousOneUntilTheNextTake) {
  Census census;
  SnapshotSlot slot;
  slot.publish(census.make(1));
  const scene::SceneSnapshot* first = slot.take();
  slot.publish(census.make(2));
  const scene::SceneSnapshot* second = slot.take();
  slot.collect();
  EXPECT_EQ(first->revision, 1U);
  EXPECT_EQ(second->revision, 2U);
  EXPECT_EQ(census.alive, 2);
  slot.take();
  EXPECT_EQ(census.alive, 2) << "freed by the reader";
  EXPECT_EQ(slot.collect(), 1U);
  EXPECT_EQ(census.alive, 1);
}

TEST(SnapshotSlot, FreesAtOnceWhatNobodyTook) {
  Census census;
  SnapshotSlot slot;
  for (std::uint64_t i = 1; i <= 100; ++i) slot.publish(census.make(i));
  EXPECT_EQ(census.alive, 1);
  EXPECT_EQ(slot.take()->revision, 100U);
}

TEST(SnapshotSlot, RandomInterleavingsNeverGoBackLeakOrFreeWhatIsInUse) {
  Census census;
  std::mt19937 random(1);
  for (int round = 0; round < kRounds / 200; ++round) {
    SnapshotSlot slot;
    std::uint64_t published = 0;
    const scene::SceneSnapshot* current = nullptr;
    const scene::SceneSnapshot* previous = nullptr;
    std::uint64_t currentRevision = 0;
    std::uint64_t previousRevision = 0;
    for (int step = 0; step < 200; ++step) {
      switch (random() % 3) {
        case 0:
          slot.publish(census.make(++published));
          break;
        case 1:
          slot.collect();
          break;
        default:
          const scene::SceneSnapshot* taken = slot.take();
          if (taken != current) {
            previous = current;
            previousRevision = currentRevision;
          } else {
            previous = nullptr;
          }
          current = taken;
          if (current != nullptr) {
            ASSERT_GE(current->revision, currentRevision);
            currentRevision = current->revision;
          }
      }
      if (current != nullptr) {
        ASSERT_EQ(current->revision, currentRevision);
      }
      if (previous != nullptr) {
        ASSERT_EQ(previous->revision, previousRevision);
      }
      ASSERT_LE(census.alive, 7);  // mailbox, current, retired and a ring of four
    }
  }
  EXPECT_EQ(census.alive, 0);
}

TEST(SnapshotSlot, TwoThreadsNeverFreeOnTheReader) {
  Census census;
  {
    SnapshotSlot slot;
    std::atomic<bool> done{false};
    std::atomic<int> wrong{0};
    std::thread reader([&] {
      std::uint64_t last = 0;
      const scene::SceneSnapshot* before = nullptr;
      while (!done.load(std::memory_order_acquire)) {
        const scene::SceneSnapshot* taken = slot.take();
        if (taken == nullptr) continue;
        if (taken->revision == 0 || taken->revision < last) ++wrong;
        if (before != nullptr && before->revision == 0) ++wrong;
        last = taken->revision;
        before = taken;
      }
    });
    for (int i = 1; i <= kRounds; ++i) slot.publish(census.make(static_cast<std::uint64_t>(i)));
    done.store(true, std::memory_order_release);
    reader.join();
    EXPECT_EQ(wrong, 0);
  }
  EXPECT_EQ(census.alive, 0);
  EXPECT_EQ(census.freed, kRounds);
  EXPECT_EQ(census.freedElsewhere, 0);
}

TEST(SpscRing, RoundsUpToAPowerOfTwo) {
  EXPECT_EQ(SpscRing<int>(0).capacity(), 1U);
  EXPECT_EQ(SpscRing<int>(5).capacity(), 8U);
  EXPECT_EQ(SpscRing<int>(8).capacity(), 8U);
}

TEST(SpscRing, CountsWhatItCouldNotHold) {
  SpscRing<int> ring(4);
  for (int i = 0; i < 7; ++i) EXPECT_EQ(ring.push(i), i < 4);
  EXPECT_EQ(ring.dropped(), 3U);
  std::vector<int> seen;
  EXPECT_EQ(ring.consume([&](int i) { seen.push_back(i); }), 4U);
  EXPECT_EQ(seen, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_TRUE(ring.push(9));
}

TEST(SpscRing, RandomInterleavingsKeepOrderAndCount) {
  SpscRing<int> ring(16);
  std::deque<int> model;
  std::mt19937 random(2);
  std::uint64_t refused = 0;
  for (int i = 0; i < kRounds; ++i) {
    if (random() % 24 != 0) {
      if (ring.push(i)) {
        model.push_back(i);
      } else {
        ASSERT_EQ(model.size(), 16U);
        ++refused;
      }
    } else {
      ring.consume([&](int value) {
        ASSERT_FALSE(model.empty());
        ASSERT_EQ(value, model.front());
        model.pop_front();
      });
      ASSERT_TRUE(model.empty());
    }
  }
  EXPECT_GT(refused, 0U);
  EXPECT_EQ(ring.dropped(), refused);
}

TEST(SpscRing, TwoThreadsLoseNothingUncounted) {
  struct Item {
    int number = 0;
    std::array<int, 40> body{};
  };
  SpscRing<Item> ring(64);
  std::atomic<bool> done{false};
  std::thread producer([&] {
    Item item;
    for (int i = 1; i <= kRounds; ++i) {
      item.number = i;
      item.body.fill(i);
      ring.push(item);
    }
    done.store(true, std::memory_order_release);
  });
  int last = 0;
  std::uint64_t received = 0;
  int torn = 0;
  const auto look = [&](const Item& item) {
    if (item.number <= last) ++torn;
    for (int value : item.body) torn += value != item.number;
    last = item.number;
  };
  while (!done.load(std::memory_order_acquire)) received += ring.consume(look);
  received += ring.consume(look);
  producer.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(received + ring.dropped(), static_cast<std::uint64_t>(kRounds));
}

TEST(LatestValue, ShowsTheNewestAndKeepsIt) {
  LatestValue<int> value;
  EXPECT_EQ(value.read(), 0);
  value.write(1);
  value.write(2);
  EXPECT_EQ(value.read(), 2);
  EXPECT_EQ(value.read(), 2);
  value.write(3);
  EXPECT_EQ(value.read(), 3);
}

TEST(LatestValue, TwoThreadsNeverSeeATornOrOlderValue) {
  struct Item {
    std::array<int, 32> body{};
  };
  LatestValue<Item> value;
  std::atomic<bool> done{false};
  std::thread writer([&] {
    Item item;
    for (int i = 1; i <= kRounds; ++i) {
      item.body.fill(i);
      value.write(item);
    }
    done.store(true, std::memory_order_release);
  });
  int wrong = 0;
  int last = 0;
  while (!done.load(std::memory_order_acquire)) {
    const Item& item = value.read();
    if (item.body[0] < last) ++wrong;
    last = item.body[0];
    for (int word : item.body) wrong += word != last;
  }
  writer.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(value.read().body[0], kRounds);
}

}  // namespace
}  // namespace hapticd::handoff
